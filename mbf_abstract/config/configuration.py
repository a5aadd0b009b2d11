"""What a configuration is, before and after it is checked; ``reading`` makes it of a file.

A configuration has MBF's shape: navigation parameters at the top, ordered plugin lists, a block of parameters per
plugin name, and the map sections that the server of the backend declares::

    backend: mesh
    controller_frequency: 20.0
    planners:
      - {name: cvp, type: cvp}
    cvp: {cost_limit: 0.9}
    mesh_map:
      mesh_file: hill.ply
      layers:
        - {name: steepness, type: steepness}
      steepness: {threshold: 0.5}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mbf_abstract.config.findings import Finding
from mbf_abstract.config.map_section import Section
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel, PluginParameters, parameter
from mbf_abstract.plugins import Plugin, PluginKind

PLUGIN_LISTS: dict[str, PluginKind] = {
    "planners": PluginKind.PLANNER,
    "controllers": PluginKind.CONTROLLER,
    "recovery_behaviors": PluginKind.RECOVERY,
    "refiners": PluginKind.REFINER,
}
"""Key of the list and kind of its plugins."""


class PluginDeclaration(ParameterModel):
    """One item of a plugin list. A server may derive it to add keys of its own, e.g. which costmap to use."""

    name: str = parameter(..., "Name of the instance; its parameters stand in the block of this name.")
    type: str = parameter(..., "Type of the plugin: a registered name or module:Class.")
    optional: bool = parameter(False, "Whether to go on without this plugin if its class cannot be loaded.")


@dataclass(frozen=True)
class PluginSpec:
    """One plugin that is ready to be constructed.

    Attributes
    ----------
    options : mapping
        Keys of the declaration that the server added.
    line : int
        Line of the declaration, for errors of the constructor.
    """

    kind: PluginKind
    name: str
    type_name: str
    plugin_class: type[Plugin]
    parameters: PluginParameters
    options: Mapping[str, Any] = field(default_factory=dict)
    line: int = 0
    optional: bool = False


@dataclass(frozen=True)
class SkippedPlugin:
    """An optional plugin that is left out, and why."""

    kind: PluginKind
    name: str
    reason: str


@dataclass(frozen=True)
class RawConfig:
    """A configuration file whose backend is known and nothing else is checked."""

    backend: str
    allow_module_types: bool
    document: YamlDocument
    findings: tuple[Finding, ...] = ()

    @property
    def path(self) -> Path:
        """The file."""
        return self.document.path


@dataclass(frozen=True)
class Config:
    """A configuration in which everything is legal.

    Attributes
    ----------
    plugins : tuple of PluginSpec
        In the order of the lists; the first of a kind is that kind's default.
    sections : mapping of str to Section
        The map sections that the server declared.
    """

    backend: str
    path: Path
    parameters: NavigationParameters
    plugins: tuple[PluginSpec, ...] = ()
    skipped: tuple[SkippedPlugin, ...] = ()
    sections: Mapping[str, Section] = field(default_factory=dict)
