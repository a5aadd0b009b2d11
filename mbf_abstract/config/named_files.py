"""The files that a configuration names, before a map is built from them: one that is missing has a key and a line."""

from __future__ import annotations

from collections.abc import Iterator

from mbf_abstract.config.bounded_files import configured_file, is_there
from mbf_abstract.config.configuration import Config
from mbf_abstract.config.findings import ConfigError, KeyPath
from mbf_abstract.config.yaml_source import YamlDocument, read_yaml
from mbf_abstract.parameters import ParameterModel


def refuse_missing_files(config: Config) -> None:
    """Raise ConfigError about all parameters of maps and layers whose file (``reads_file``) is not there."""
    document = read_yaml(config.path, []) or YamlDocument(config.path, {})
    findings = []
    for path, parameters in _blocks(config):
        for name, field in type(parameters).model_fields.items():
            extra = field.json_schema_extra
            value = getattr(parameters, name) if isinstance(extra, dict) and extra.get("reads_file") else ""
            if value and not is_there(configured_file(config.path.parent, value)):
                findings.append(document.finding((*path, name), "a file", f"{value!r}, which is not there"))
    if findings:
        raise ConfigError(findings)


def _blocks(config: Config) -> Iterator[tuple[KeyPath, ParameterModel]]:
    for key, section in config.sections.items():
        yield (key,), section.parameters
        for layer in section.layers:
            yield (key, layer.name), layer.parameters
