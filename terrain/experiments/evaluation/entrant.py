"""Who enters an evaluation: a planner or a controller of a user, checked before anything is driven."""

from __future__ import annotations

import hashlib
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.registry import PluginError, PluginRegistry
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.factory import read_config
from terrain.experiments.evaluation.protocol import Entry, Protocol
from terrain.provenance.code import hash_of_code, place_of
from terrain.provenance.named_files import InputCopies
from terrain.session.session import write_navigation_config

KINDS = {"planner": PluginKind.PLANNER, "controller": PluginKind.CONTROLLER}
OWN = ("mbf_abstract", "mbf_costmap_nav", "mbf_mesh_nav", "terrain")


def entrant(protocol: Protocol, settings: Mapping[str, str], backend: str = "", name: str = "") -> Entry:
    """Return a user's entry.

    Parameters
    ----------
    settings : mapping of str to str
        As for ``mbf run --set``, ``planner`` and ``controller`` among them.
    backend : str
        The protocol's own if empty.
    name : str
        In the table; what plans and what controls if empty.

    Raises
    ------
    ConfigError
        The protocol does not know the backend, a shipped entry has the name, or plugins and settings are wrong;
        all findings.
    """
    where = f"mbf bench {protocol.name}"
    chosen = backend or protocol.backend
    source = protocol.trials[0].scenario.navigation.get(chosen)
    if source is None:
        known = ", ".join(protocol.trials[0].scenario.navigation)
        raise ConfigError([Finding(where, 1, "--backend", f"one of {known}", repr(chosen))])
    title = name or " + ".join(settings[kind] for kind in KINDS if kind in settings) or "settings"
    if title in protocol.entries:
        expected = "a name of your own, or --beside for the shipped entry"
        raise ConfigError([Finding(where, 1, "--name", expected, repr(title))])
    _refuse_mistakes(protocol, source, settings)
    return Entry(title, chosen, settings, code_of_plugins(chosen, settings))


def _refuse_mistakes(protocol: Protocol, source: Path, settings: Mapping[str, str]) -> None:
    """Read the configuration with the settings as a run would, without a map."""
    robot = protocol.trials[0].scenario.robot
    with tempfile.TemporaryDirectory(prefix="mbf_bench_") as folder:
        try:
            read_config(write_navigation_config(source, robot, {}, Path(folder), settings, InputCopies(Path(folder))))
        except ConfigError as error:
            shown = f"{source.name} (with settings)"
            raise ConfigError([replace(finding, file=shown) for finding in error.findings]) from error


def code_of_plugins(backend: str, settings: Mapping[str, str]) -> str:
    """Return a hash of the packages of planner and controller that are not of this project; empty without one.

    A module that stands alone counts as a package. A plugin that changes is another entry, which is driven anew.
    """
    registry, digests = PluginRegistry(backend), list[str]()
    for key, kind in KINDS.items():
        try:
            package = registry.module_of(kind, settings[key]).partition(".")[0] if key in settings else ""
        except PluginError:
            continue  # a name of the configuration, which stands for a type of this project
        place = place_of(package) if package in sys.modules and package not in OWN else None
        digests += [] if place is None else [hash_of_code(place)]
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:12] if digests else ""
