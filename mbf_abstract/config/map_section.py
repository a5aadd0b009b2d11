"""Map sections of a configuration: the block of one map, with a list of layers and a block for each of them.

The core knows no map. A server declares its sections as parameter models; a model with a field ``layers`` (items with
``name`` and ``type``) has its layers' classes loaded from the group ``<backend>_layers`` and their blocks checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mbf_abstract.config.findings import Finding, KeyPath
from mbf_abstract.config.registry import PluginError, PluginRegistry
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument
from mbf_abstract.parameters import ParameterModel


@dataclass(frozen=True)
class LayerSpec:
    """One layer that is ready to be constructed.

    Attributes
    ----------
    layer_class : type
        Class of the layer.
    parameters : ParameterModel
        Validated instance of the class's ``Parameters``.
    """

    name: str
    type_name: str
    layer_class: type
    parameters: ParameterModel


@dataclass(frozen=True)
class Section:
    """A checked map section: its own parameters, and its layers in order."""

    parameters: ParameterModel
    layers: tuple[LayerSpec, ...] = ()


def split_layer_blocks(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a section into its own keys and the blocks that bear the name of one of its ``layers``."""
    layers = data.get("layers")
    items = layers if isinstance(layers, list) else []
    names = {item["name"] for item in items if isinstance(item, dict) and isinstance(item.get("name"), str)}
    own = {key: value for key, value in data.items() if key not in names}
    return own, {key: value for key, value in data.items() if key in names}


class SectionValidator:
    """Checks sections of one document; what is wrong is appended to ``findings``."""

    def __init__(self, document: YamlDocument, registry: PluginRegistry, findings: list[Finding]) -> None:
        self._document = document
        self._registry = registry
        self._findings = findings

    def validate(self, model: type[ParameterModel], key: str) -> Section | None:
        """Return the checked section at the top-level key ``key``, or None if anything in it is wrong."""
        data, before = self._document.data.get(key), len(self._findings)
        if "layers" not in model.model_fields or not isinstance(data, Mapping):
            parameters = validate(model, data, self._document, (key,), self._findings)
            return None if parameters is None else Section(parameters)
        own, blocks = split_layer_blocks(data)
        parameters = validate(model, own, self._document, (key,), self._findings)
        layers = self._layers(model, own, blocks, key)
        if parameters is None or len(self._findings) > before:
            return None
        return Section(parameters, tuple(layers))

    def _layers(
        self, model: type[ParameterModel], own: Mapping[str, Any], blocks: Mapping[str, Any], key: str
    ) -> list[LayerSpec]:
        """Check the layers even if the section itself is wrong, so that all findings come at once."""
        items = own["layers"] if isinstance(own.get("layers"), list) else []
        specs, lines = [], dict.fromkeys(model.model_fields, 0)
        for index, item in enumerate(items):
            name, type_name = (item.get("name"), item.get("type")) if isinstance(item, Mapping) else (None, None)
            if not (isinstance(name, str) and isinstance(type_name, str)):
                continue  # the section's model has reported it
            path = (key, "layers", index)
            if name in lines:
                hint = f"first in line {lines[name]}" if lines[name] else "a key of the section"
                self._report((*path, "name"), "a name of its own", repr(name), hint)
                continue
            lines[name] = self._document.line(path)
            specs.append(self._layer(name, type_name, blocks.get(name), path))
        return [spec for spec in specs if spec is not None]

    def _layer(self, name: str, type_name: str, block: object, path: KeyPath) -> LayerSpec | None:
        group = f"{self._registry.backend}_layers"
        try:
            layer_class = self._registry.load(group, type_name)
        except PluginError as error:
            self._report((*path, "type"), f"a type of {group} that loads", repr(type_name), error.reason)
            return None
        model = getattr(layer_class, "Parameters", None)
        if not (isinstance(model, type) and issubclass(model, ParameterModel)):
            self._report((*path, "type"), "a class with Parameters", repr(type_name))
            return None
        parameters = validate(model, block, self._document, (path[0], name), self._findings)
        return None if parameters is None else LayerSpec(name, type_name, layer_class, parameters)

    def _report(self, path: KeyPath, expected: str, got: str, hint: str = "") -> None:
        self._findings.append(self._document.finding(path, expected, got, hint))
