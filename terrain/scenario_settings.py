"""Settings that a run or a sweep makes on top of a navigation configuration, such as ``planner=cvp``.

``planner`` and ``controller`` choose the default plugin by its name in the configuration or by its type; any other
key is a dotted path, e.g. ``mesh_map.edge_cost_factor``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from mbf_abstract.findings import ConfigError, Finding

PLUGIN_LISTS = {"planner": "planners", "controller": "controllers"}


def apply_settings(text: str, settings: Mapping[str, str]) -> str:
    """Return a configuration's YAML text with the settings made.

    Raises
    ------
    ConfigError
        A dotted path leads through something that is no block of keys.
    """
    if not settings:
        return text
    config: dict[str, Any] = yaml.safe_load(text)
    for key, value in settings.items():
        if key in PLUGIN_LISTS:
            config[PLUGIN_LISTS[key]] = _with_default(config.get(PLUGIN_LISTS[key]) or [], value)
        else:
            _set(config, key, yaml.safe_load(value))
    return yaml.safe_dump(config, sort_keys=False)


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
