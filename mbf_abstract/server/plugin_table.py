"""The plugins a server has loaded: by kind and name, in load order; the first is the default."""

from __future__ import annotations

from typing import Any

from mbf_abstract.execution.loaded_plugin import LoadedPlugin, PluginGone
from mbf_abstract.plugins import PluginKind

_KIND_NAMES = {
    PluginKind.PLANNER: "planner",
    PluginKind.CONTROLLER: "controller",
    PluginKind.RECOVERY: "recovery behavior",
    PluginKind.REFINER: "refiner",
}


class PluginTable:
    """Loaded plugins of all kinds."""

    def __init__(self) -> None:
        self._plugins: dict[PluginKind, dict[str, LoadedPlugin[Any]]] = {kind: {} for kind in PluginKind}

    def add(self, kind: PluginKind, plugin: LoadedPlugin[Any]) -> None:
        """Add a plugin; raises ValueError if the name is taken."""
        if plugin.name in self._plugins[kind]:
            raise ValueError(f"a {_KIND_NAMES[kind]} named {plugin.name!r} is loaded already")
        self._plugins[kind][plugin.name] = plugin

    def replace(self, kind: PluginKind, plugin: LoadedPlugin[Any]) -> None:
        """Put a plugin in the place of the one of its name."""
        self._plugins[kind][plugin.name] = plugin

    def remove(self, kind: PluginKind, name: str) -> None:
        """Remove a plugin; raises KeyError if there is none of that name."""
        del self._plugins[kind][name]

    def names(self, kind: PluginKind) -> list[str]:
        """Names in load order."""
        return list(self._plugins[kind])

    def all_of(self, kind: PluginKind) -> list[LoadedPlugin[Any]]:
        """Plugins of one kind in load order."""
        return list(self._plugins[kind].values())

    def find(self, kind: PluginKind, name: str) -> LoadedPlugin[Any] | None:
        """Plugin by name; an empty name is the first loaded."""
        plugins = self._plugins[kind]
        return next(iter(plugins.values()), None) if not name else plugins.get(name)

    def get(self, kind: PluginKind, name: str) -> LoadedPlugin[Any]:
        """Plugin of an accepted goal; raises PluginGone if it was unloaded since."""
        plugin = self.find(kind, name)
        if plugin is None:
            raise PluginGone(self.problem(kind, name))
        return plugin

    def problem(self, kind: PluginKind, name: str) -> str:
        """Why ``name`` can not be used; empty if it can."""
        plugin = self.find(kind, name)
        if plugin is None:
            loaded = ", ".join(self._plugins[kind]) or "none"
            wanted = f"no {_KIND_NAMES[kind]} named {name!r}" if name else f"no {_KIND_NAMES[kind]} is loaded"
            return f"{wanted}; loaded: {loaded}" if name else wanted
        if plugin.quarantined:
            return f"{_KIND_NAMES[kind]} {plugin.name!r} is quarantined: {plugin.quarantined}"
        return ""
