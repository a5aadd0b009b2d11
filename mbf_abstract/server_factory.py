"""From a configuration file to a running server: the one line ``backend:`` chooses the class."""

from __future__ import annotations

import os
from typing import Any

from mbf_abstract.clock import Clock
from mbf_abstract.config import Config, RawConfig, load_config, validate_config
from mbf_abstract.events import EventBus
from mbf_abstract.findings import ConfigError
from mbf_abstract.registry import PluginError, PluginRegistry
from mbf_abstract.robot import Robot
from mbf_abstract.server import AbstractNavigationServer
from mbf_abstract.transforms import TransformBuffer


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
    return cls, validate_config(raw, cls.config_sections, registry, cls.plugin_declaration)


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
