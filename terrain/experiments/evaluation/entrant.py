"""Who enters an evaluation: a planner or a controller of a user, checked before anything is driven."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Mapping
from pathlib import Path

import yaml

from mbf_abstract.config.configuration import Config
from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.server.factory import read_config
from terrain.experiments.evaluation.protocol import Entry, Protocol
from terrain.provenance.code import hash_of_code, modules_of_plugins, place_of
from terrain.provenance.named_files import InputCopies, hash_with_named_files, named_files
from terrain.session.navigation_config import errors_in_source, write_navigation_config

KINDS = ("planner", "controller")
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
    known = protocol.trials[0].scenario.navigation
    if chosen not in known:
        raise ConfigError([Finding(where, 1, "--backend", f"one of {', '.join(known)}", repr(chosen))])
    title = name or " + ".join(settings[kind] for kind in KINDS if kind in settings) or "settings"
    if title in protocol.entries:
        expected = "a name of your own, or --beside for the shipped entry"
        raise ConfigError([Finding(where, 1, "--name", expected, repr(title))])
    config, registry = configuration_of(protocol, chosen, settings)
    return Entry(title, chosen, settings, code_of(config, registry, settings))


def configuration_of(protocol: Protocol, backend: str, settings: Mapping[str, str]) -> tuple[Config, PluginRegistry]:
    """Read the protocol's configuration with the settings as a run would, without a map; raises ConfigError."""
    scenario = protocol.trials[0].scenario
    source = scenario.navigation[backend]
    with tempfile.TemporaryDirectory(prefix="mbf_bench_") as name:
        folder = Path(name)
        with errors_in_source(source, folder, settings):
            written = write_navigation_config(source, scenario.robot, {}, folder, settings, InputCopies(folder))
            server, config = read_config(written)
            return config, server.plugin_registry()


def code_of(config: Config, registry: PluginRegistry, settings: Mapping[str, str]) -> str:
    """Return a hash of what decides a drive and is not of this project; empty without any.

    It is of the packages of all plugins and layers, and of the files that settings name. With a module that stands
    alone all modules of its folder count: it may import them. What changes is another entry, which is driven anew.
    """
    packages = {module.partition(".")[0] for module in modules_of_plugins(config, registry)} - set(OWN)
    places = [place for package in sorted(packages) if (place := place_of(package)) is not None]
    code = [file for place in places for file in (sorted(place.parent.glob("*.py")) if place.is_file() else [place])]
    digests = [hash_of_code(place) for place in code]
    named = named_files([yaml.safe_load(value) for value in settings.values()], Path())
    digests += [hash_with_named_files(named[text]).hex() for text in sorted(named)]
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:12] if digests else ""
