"""The plugins of a server at run time: load, unload, reload, change parameters. Refused while a goal uses the plugin.

The server derives it. A server of a map defines in ``make_context`` what its plugins are constructed with, and in
class attributes which types and options it knows.
"""

from __future__ import annotations

import zlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from mbf_abstract.config.configuration import PluginDeclaration, PluginSpec
from mbf_abstract.config.registry import Adapter, PluginRegistry
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.maps.map_plugin import needs_another_map
from mbf_abstract.parameters import checked_parameters, with_changes
from mbf_abstract.plugins import Plugin, PluginContext, PluginKind
from mbf_abstract.server.plugin_table import PluginTable


class ServerError(Exception):
    """A plugin can not be loaded, unloaded or changed; the text gives the reason."""


class PluginHost(ABC):
    """What a server does with its plugins beside running them."""

    backend: ClassVar[str]
    """Prefix of this server's plugin types, e.g. ``mesh``."""
    plugin_prefix: ClassVar[str] = ""
    """Prefix of its plugin types where that is not the backend's name."""
    plugin_declaration: ClassVar[type[PluginDeclaration]] = PluginDeclaration
    """Items of the plugin lists, with the options this server knows."""
    plugin_adapters: ClassVar[Sequence[Adapter]] = ()
    """Asked about a class that is no MBF plugin, e.g. to wrap a nav_core-style one."""
    map_type: ClassVar[type | None] = None
    """What its plugins are given as a map, so that a configuration's can be checked; None = not known before it is."""

    def __init__(self, runtime: Runtime, seed: int) -> None:
        self.runtime = runtime
        self.plugins = PluginTable()
        self._seed = seed

    @abstractmethod
    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Return the context a plugin of this kind is constructed with: ``base`` and the map."""

    @classmethod
    def plugin_registry(cls, allow_module_types: bool = True) -> PluginRegistry:
        """Registry of this server's plugin types."""
        return PluginRegistry(
            cls.plugin_prefix or cls.backend,
            allow_module_types=allow_module_types,
            adapters=cls.plugin_adapters,
            misfit=cls.plugin_misfit,
        )

    @classmethod
    def plugin_misfit(cls, plugin_class: type) -> str:
        """Why a plugin class cannot be used on the server's map; empty if it can, or if that is not known yet."""
        return needs_another_map(plugin_class, cls.map_type)

    def load_plugin(self, spec: PluginSpec) -> None:
        """Construct and add a plugin; raises ServerError with the reason if its constructor fails."""
        try:
            self.plugins.add(spec.kind, self._construct(spec))
        except (Exception, SystemExit) as error:
            text = _failure(spec, error)
            if not spec.optional:
                raise ServerError(text) from error
            self.runtime.events.emit(EventKind.FAULT, "server", message=f"optional plugin left out: {text}")

    def load_plugin_type(
        self, kind: PluginKind, name: str, type_name: str, options: Mapping[str, Any] | None = None, **parameters: Any
    ) -> None:
        """Load a plugin at run time by its type, as a configuration would.

        Parameters
        ----------
        kind, name, type_name
            As in a plugin list; the type may be a registered name or ``module:Class``.
        options : mapping
            Keys of the declaration that this server added, e.g. which costmap to use.
        **parameters
            Values of the plugin's parameter block.

        Raises
        ------
        PluginError
            The type is unknown or is no plugin of this kind.
        ParameterError
            A parameter is not legal.
        ServerError
            The name is taken, or the constructor raised.
        """
        plugin_class = self.plugin_registry().load(kind, type_name)
        values = checked_parameters(plugin_class.Parameters, parameters, (name,))  # type: ignore[attr-defined]
        self.load_plugin(PluginSpec(kind, name, type_name, plugin_class, values, options or {}))

    def reload_plugin(self, kind: PluginKind, name: str) -> None:
        """Replace a plugin by one of its class's changed source, with its present parameters and its place in the list.

        The old instance stays where anything goes wrong.

        Raises
        ------
        PluginError
            The source does not load any more.
        ParameterError
            The new class does not take the present parameters.
        ServerError
            No such plugin, a goal is using it, or the new constructor raised.
        """
        old = self._loaded(kind, name)
        plugin_class = self.plugin_registry().reload(kind, old.spec.type_name)
        with self._in_own_use(old, "a reload"):  # not the parameters of a goal
            present = old.instance.parameters.model_dump()
        values = checked_parameters(plugin_class.Parameters, present, (name,))  # type: ignore[attr-defined]
        try:
            new = self._construct(replace(old.spec, plugin_class=plugin_class, parameters=values))
        except (Exception, SystemExit) as error:
            raise ServerError(_failure(old.spec, error)) from error
        if not old.retire():
            raise ServerError(f"{old.title} is in use")
        self.plugins.replace(kind, new)

    def _construct(self, spec: PluginSpec) -> LoadedPlugin[Any]:
        rng = np.random.default_rng([self._seed, zlib.crc32(spec.name.encode())])
        runtime = self.runtime
        base = PluginContext(
            spec.name,
            spec.parameters,
            runtime.clock,
            rng,
            runtime.robot,
            relaxation=runtime.relaxation,
            min_turning_radius=runtime.gate.limits.min_turning_radius,
            may_reverse=runtime.gate.limits.min_vel_x < 0.0,
            traffic=runtime.traffic,
        )
        instance: Plugin = spec.plugin_class(self.make_context(spec.kind, spec.options, base))
        return LoadedPlugin(spec, instance, runtime)

    def further_instance(self, kind: PluginKind, name: str) -> Any:
        """Construct another instance of a loaded plugin, with its present parameters, for use beside the actions.

        Raises
        ------
        ServerError
            No such plugin, a goal is using it, or its constructor raised.
        """
        plugin = self._loaded(kind, name)
        with self._in_own_use(plugin, "a further instance"):  # not the parameters of a goal
            spec = replace(plugin.spec, parameters=plugin.instance.parameters)
        try:
            return self._construct(spec).instance
        except (Exception, SystemExit) as error:
            raise ServerError(_failure(spec, error)) from error

    def _loaded(self, kind: PluginKind, name: str) -> LoadedPlugin[Any]:
        plugin = self.plugins.find(kind, name) if name else None
        if plugin is None:
            raise ServerError(f"no {kind.name.lower()} named {name!r} is loaded")
        return plugin

    def unload_plugin(self, kind: PluginKind, name: str) -> None:
        """Remove a plugin; raises ServerError if there is none of that name or a goal is using it."""
        plugin = self._loaded(kind, name)
        if not plugin.retire():
            raise ServerError(f"{plugin.title} is in use")
        self.plugins.remove(kind, name)

    def set_plugin_parameters(self, kind: PluginKind, name: str, **changes: Any) -> None:
        """Change parameters of a plugin between two of its calls.

        Raises
        ------
        ServerError
            No such plugin, or it is in use.
        ParameterError
            A value is not legal, or the parameter is read once only; nothing is changed. A ValueError.
        """
        plugin = self._loaded(kind, name)
        instance = plugin.instance
        with self._in_own_use(plugin, "a change of its parameters"):
            old, new = instance.parameters, with_changes(instance.parameters, changes, where=(name,))
            try:
                instance.parameters = new
                instance.parameters_changed()
            except BaseException:
                instance.parameters = old
                raise
        self.runtime.events.emit(EventKind.PARAMETER_CHANGED, name, **changes)

    @contextmanager
    def _in_own_use(self, plugin: LoadedPlugin[Any], user: str) -> Iterator[None]:
        """Keep goals, which may bring parameters of their own, from a plugin; raises ServerError if one is using it."""
        if not plugin.acquire(user, lambda: True):
            raise ServerError(f"{plugin.title} is in use")
        try:
            yield
        finally:
            plugin.release(user)


def _failure(spec: PluginSpec, error: BaseException) -> str:
    kind = spec.kind.name.lower()
    return f"{kind} {spec.name!r} ({spec.type_name}): {type(error).__name__}: {error_text(error)}"
