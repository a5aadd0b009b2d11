"""From a configuration file to a running server: the one line ``backend:`` chooses the class."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mbf_abstract.config.configuration import Config, RawConfig
from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.installed_plugins import installed_points
from mbf_abstract.config.reading import load_config, validate_config
from mbf_abstract.config.registry import PluginError, PluginRegistry
from mbf_abstract.drive.robot import Robot
from mbf_abstract.event_bus import EventBus
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.view import FloorMap
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock

MAP_FILES_GROUP = "mbf.map_files"


def server_class(raw: RawConfig, registry: PluginRegistry | None = None) -> type[AbstractNavigationServer]:
    """Find the server class of a configuration's ``backend``; raises ConfigError if there is none.

    ``allow_module_types: false`` holds for the backend, too, unless a ``registry`` of one's own says otherwise.
    """
    registry = registry or PluginRegistry(allow_module_types=raw.allow_module_types)
    try:
        found: Any = registry.load("servers", raw.backend, AbstractNavigationServer)
    except PluginError as error:
        finding = raw.document.finding(("backend",), "a known backend or module:Class", error.reason)
        raise ConfigError([finding]) from error
    return found  # type: ignore[no-any-return]


def read_config(path: str | os.PathLike[str]) -> tuple[type[AbstractNavigationServer], Config]:
    """Read and validate a configuration file; raises ConfigError with all findings at once."""
    raw = load_config(path)
    cls = server_class(raw)
    registry = cls.plugin_registry(raw.allow_module_types)
    return cls, validate_config(raw, cls.config_sections, registry, cls.plugin_declaration, cls.map_names)


def installed_servers(suffix: str = "") -> Iterator[type[AbstractNavigationServer]]:
    """Server classes of all installed packages; each is imported when its turn comes.

    Parameters
    ----------
    suffix : str
        Of a map file, such as ``.ply``. Servers that an entry point of the group ``mbf.map_files`` names for it come
        first, so that the others need not be imported; else they come by their names.
    """
    registry = PluginRegistry()
    servers = {point.name: point.value for point in installed_points("mbf.servers")}
    reading = {point.value for point in installed_points(MAP_FILES_GROUP) if f".{point.name}" == suffix.lower()}
    for name in sorted(servers, key=lambda name: (servers[name] not in reading, name)):
        yield registry.load("servers", name, AbstractNavigationServer)


def read_floor(file: Path) -> FloorMap:
    """Read a map file by the first installed server that knows its format; raises ConfigError if it cannot be used."""
    for cls in installed_servers(file.suffix):
        floor = cls.read_floor(file)
        if floor is not None:
            return floor
    raise ConfigError([Finding(str(file), 1, "", "a map of cells that an installed server reads", repr(file.suffix))])


def make_server(
    path: str | os.PathLike[str],
    robot: Robot,
    clock: Clock,
    transforms: TransformBuffer | None = None,
    events: EventBus | None = None,
    seed: int = 0,
) -> AbstractNavigationServer:
    """Make the server that a configuration file asks for.

    Raises
    ------
    ConfigError
        The file is missing, not legal YAML or not a legal configuration; all findings with file and line.
    ServerError
        A plugin's constructor failed.
    """
    cls, config = read_config(path)
    return cls(config, robot, clock, transforms, events, seed)
