"""From a configuration file to a ``Config``, with every mistake reported at once.

Two steps, because only the backend's server knows its sections: ``load_config`` reads the file and finds the backend,
``validate_config`` checks the rest.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, cast

from mbf_abstract.config.configuration import (
    PLUGIN_LISTS,
    Config,
    PluginDeclaration,
    PluginSpec,
    RawConfig,
    SkippedPlugin,
)
from mbf_abstract.config.findings import ConfigError, Finding, KeyPath, suggest
from mbf_abstract.config.map_section import SectionValidator
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.config.registry import PluginError, PluginRegistry
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import read_yaml
from mbf_abstract.parameters import ParameterModel, PluginParameters
from mbf_abstract.plugins import Plugin, PluginKind

_OF_SCENARIOS = {"world", "navigation"}
_OWN_KEYS = ("backend", "allow_module_types", *PLUGIN_LISTS)


def load_config(path: str | os.PathLike[str]) -> RawConfig:
    """Read a configuration file as far as its backend.

    Raises
    ------
    ConfigError
        The file is not usable YAML, or names no backend. Lesser findings are kept for ``validate_config``.
    """
    findings: list[Finding] = []
    document = read_yaml(path, findings)
    if document is None:
        raise ConfigError(findings)
    if document.data.keys() >= _OF_SCENARIOS and not document.data.keys() & PLUGIN_LISTS.keys():
        hint = "mbf run drives it; its configurations are those that its key navigation names"
        raise ConfigError([*findings, document.finding((), "a configuration", "a scenario", hint)])
    backend = document.data.get("backend")
    if not isinstance(backend, str) or not backend:
        got = "nothing" if backend is None else repr(backend)
        raise ConfigError([*findings, document.finding(("backend",), "costmap, mesh or module:Class", got)])
    allowed = document.data.get("allow_module_types", True)
    if not isinstance(allowed, bool):
        findings.append(document.finding(("allow_module_types",), "true or false", repr(allowed)))
        allowed = False
    return RawConfig(backend, allowed, document, tuple(findings))


def validate_config(
    raw: RawConfig,
    sections: Mapping[str, type[ParameterModel]],
    registry: PluginRegistry,
    declaration: type[PluginDeclaration] = PluginDeclaration,
    map_names: Sequence[str] = (),
) -> Config:
    """Check a whole configuration and load the classes it names.

    Parameters
    ----------
    sections : mapping of str to type
        Map sections of the server, by key. A model with a field ``layers`` has a block per layer inside its section.
    registry : PluginRegistry
        Of the server's backend.
    declaration : type
        Items of the plugin lists.
    map_names : sequence of str
        Maps that a plugin's parameters can choose from; parameter models get them as ``info.context["map_names"]``.

    Raises
    ------
    ConfigError
        Everything that is wrong with the file.
    """
    return _Validation(raw, sections, registry, declaration, map_names).run()


class _Validation:
    """One pass over a configuration; collects findings and results."""

    def __init__(
        self,
        raw: RawConfig,
        sections: Mapping[str, type[ParameterModel]],
        registry: PluginRegistry,
        declaration: type[PluginDeclaration],
        map_names: Sequence[str],
    ) -> None:
        self.raw = raw
        self.document = raw.document
        self.data = raw.document.data
        self.sections = sections
        self.registry = registry
        self.declaration = declaration
        self.context = {"map_names": map_names}
        self.findings = list(raw.findings)
        self.plugins: list[PluginSpec] = []
        self.skipped: list[SkippedPlugin] = []
        self.lines_of_names: dict[str, int] = {}

    def run(self) -> Config:
        parameters = self._parameters()
        for key, kind in PLUGIN_LISTS.items():
            self._plugin_list(key, kind)
        self._listed_names("escalation_behaviors", "recovery_behaviors")
        self._listed_names("right_of_way_behavior", "recovery_behaviors")
        self._listed_names("fallback_planner", "planners")
        self._listed_names("plan_refiner", "refiners")
        validator = SectionValidator(self.document, self.registry, self.findings)
        sections = {key: validator.validate(model, key) for key, model in self.sections.items()}
        self._unknown_keys()
        if self.findings or parameters is None:
            raise ConfigError(self.findings)
        checked = {key: section for key, section in sections.items() if section is not None}
        plugins, skipped = tuple(self.plugins), tuple(self.skipped)
        return Config(self.raw.backend, self.document.path, parameters, plugins, skipped, checked)

    def _parameters(self) -> NavigationParameters | None:
        own = {key: value for key, value in self.data.items() if key in NavigationParameters.model_fields}
        return validate(NavigationParameters, own, self.document, (), self.findings)

    def _plugin_list(self, key: str, kind: PluginKind) -> None:
        items = self.data.get(key)
        if items is None:
            return
        if not isinstance(items, list):
            self._report((key,), "a list of {name, type}", repr(items)[:60])
            return
        for index, item in enumerate(items):
            declared = validate(self.declaration, item, self.document, (key, index), self.findings)
            name = declared.name if declared else item.get("name") if isinstance(item, dict) else None
            if isinstance(name, str) and self._name_is_free(name, (key, index, "name")) and declared:
                self._plugin(kind, declared, (key, index))

    def _listed_names(self, key: str, plugin_list: str) -> None:
        """Check that the plugins a key names, one or a list of them, are among those of a list of the file."""
        names, items = self.data.get(key), self.data.get(plugin_list)
        named = (item.get("name") for item in items if isinstance(item, dict)) if isinstance(items, list) else ()
        listed = [name for name in named if isinstance(name, str)]
        paths: list[tuple[KeyPath, Any]] = [((key,), names)]
        if isinstance(names, list):
            paths = [((key, index), name) for index, name in enumerate(names)]
        for path, name in paths:
            if isinstance(name, str) and name and name not in listed:
                self._report(path, f"the name of one of the {plugin_list}", repr(name), suggest(name, listed))

    def _name_is_free(self, name: str, path: KeyPath) -> bool:
        if name in self.lines_of_names:
            hint = f"first in line {self.lines_of_names[name]}"
            self._report(path, "a name no other plugin has", repr(name), hint)
            return False
        self.lines_of_names[name] = self.document.line(path)
        if not name or name in _OWN_KEYS or name in NavigationParameters.model_fields or name in self.sections:
            self._report(path, "a name that is no key of the configuration", repr(name))
            return False
        return True

    def _plugin(self, kind: PluginKind, declared: PluginDeclaration, path: KeyPath) -> None:
        plugin_class = self._load(kind, declared.type, (*path, "type"), declared.name if declared.optional else "")
        if plugin_class is None:
            return
        block = self.data.get(declared.name)
        key_path = (declared.name,)
        parameters = validate(plugin_class.Parameters, block, self.document, key_path, self.findings, self.context)
        if parameters is None:
            return
        self._inner_plugins(plugin_class, parameters, key_path)
        options = declared.model_dump(exclude=set(PluginDeclaration.model_fields))
        line, name = self.document.line(path), declared.name
        spec = PluginSpec(kind, name, declared.type, plugin_class, parameters, options, line, declared.optional)
        self.plugins.append(spec)

    def _inner_plugins(self, plugin_class: type[Plugin], parameters: PluginParameters, path: KeyPath) -> None:
        """Check the plugins that stand in the block of another one, by the same registry and the same rules."""
        for inner in plugin_class.inner_plugins:
            type_name, block_path = getattr(parameters, inner.type_key), (*path, inner.block_key)
            inner_class = self._load(inner.kind, type_name, (*path, inner.type_key))
            if inner_class is None:
                continue
            block = getattr(parameters, inner.block_key)
            checked = validate(inner_class.Parameters, block, self.document, block_path, self.findings, self.context)
            if checked is not None:
                self._inner_plugins(inner_class, checked, block_path)

    def _load(self, kind: PluginKind, type_name: str, path: KeyPath, optional: str = "") -> type[Plugin] | None:
        """Load a plugin class; one that cannot be loaded is a finding, or skipped under the name ``optional``."""
        try:
            return cast("type[Plugin]", self.registry.load(kind, type_name))
        except PluginError as error:
            if optional:
                self.skipped.append(SkippedPlugin(kind, optional, str(error)))
            else:
                self._report(path, f"a type of {kind.value} that loads", repr(type_name), error.reason)
            return None

    def _unknown_keys(self) -> None:
        known = [*_OWN_KEYS, *NavigationParameters.model_fields, *self.sections, *self.lines_of_names]
        expected = "a known key, a section of this backend or a plugin's name"
        for key in self.data:
            if key not in known:
                self._report((key,), expected, repr(key), suggest(key, known))

    def _report(self, path: KeyPath, expected: str, got: str, hint: str = "") -> None:
        self.findings.append(self.document.finding(path, expected, got, hint))
