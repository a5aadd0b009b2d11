"""Settings that a run or a sweep makes on top of a scenario, such as ``planner=cvp`` or ``world.median_slope=12``.

``planner`` and ``controller`` choose the default plugin by its name in the navigation configuration or by its type;
``world.`` and a key change the scenario's world; any other key is a dotted path of the configuration, e.g.
``mesh_map.edge_cost_factor``. A value that is the path of a file counts from the working folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.config.validation import validate
from mbf_abstract.config.yaml_source import YamlDocument
from terrain.scenarios.scenario import Scenario

WORLD = "world."
PLUGIN_LISTS = {"planner": "planners", "controller": "controllers"}


def apply_world_settings(scenario: Scenario, settings: Mapping[str, str]) -> tuple[Scenario, dict[str, str]]:
    """Return the scenario with the settings of its world made, and the other settings.

    Raises
    ------
    ConfigError
        The world has no such key, or refuses a value; all findings.
    """
    of_world = {key: yaml.safe_load(value) for key, value in settings.items() if key.startswith(WORLD)}
    if not of_world:
        return scenario, dict(settings)
    kept = scenario.world.model_dump(exclude_unset=True)
    changed = kept | {key.removeprefix(WORLD): value for key, value in of_world.items()}
    findings: list[Finding] = []
    document = YamlDocument(Path("settings"), {"world": changed})
    world = validate(type(scenario.world), changed, document, ("world",), findings)
    if findings:
        raise ConfigError(findings)
    rest = {key: value for key, value in settings.items() if key not in of_world}
    return scenario.model_copy(update={"world": world}), rest


def apply_settings(text: str, settings: Mapping[str, str]) -> str:
    """Return a configuration's YAML text with the settings made.

    Raises
    ------
    ConfigError
        A dotted path leads through something that is no block of keys, or a key is one of the scenario.
    """
    if not settings:
        return text
    config: dict[str, Any] = yaml.safe_load(text)
    findings = [
        _of_the_scenario(key) for key in settings if _first(key) in Scenario.model_fields.keys() - config.keys()
    ]
    if findings:
        raise ConfigError(findings)
    for key, value in settings.items():
        if key in PLUGIN_LISTS:
            config[PLUGIN_LISTS[key]] = _with_default(config.get(PLUGIN_LISTS[key]) or [], value)
        else:
            file = Path(value)
            _set(config, key, str(file.absolute()) if file.suffix and file.is_file() else yaml.safe_load(value))
    return yaml.safe_dump(config, sort_keys=False)


def _first(key: str) -> str:
    return key.partition(".")[0]


def _of_the_scenario(key: str) -> Finding:
    expected = "planner, controller, world.KEY or a key of the configuration"
    return Finding(f"setting {key}", 1, "", expected, f"{_first(key)}, a key of the scenario: change it in its file")


def _with_default(plugins: list[dict[str, Any]], wanted: str) -> list[dict[str, Any]]:
    """Put the plugin with this name, or else of this type, first; a new one if there is neither."""
    named = [plugin for plugin in plugins if plugin["name"] == wanted]
    typed = [plugin for plugin in plugins if plugin["type"] == wanted]
    chosen = next(iter(named + typed), {"name": wanted.replace(":", "_").replace(".", "_"), "type": wanted})
    return [chosen, *(plugin for plugin in plugins if plugin is not chosen)]


def _set(config: dict[str, Any], key: str, value: Any) -> None:
    *blocks, last = key.split(".")
    block = config
    for name in blocks:
        block = block.setdefault(name, {})
        if not isinstance(block, dict):
            raise ConfigError([Finding(f"setting {key}", 1, name, "a block of keys", repr(block))])
    block[last] = value
