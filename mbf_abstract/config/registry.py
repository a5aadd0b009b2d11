"""The plugin registry: from the ``type:`` of a configuration to a class.

Plugins are found by entry points (groups ``mbf.planners``, ``mbf.controllers``, ``mbf.recoveries``, ``mbf.refiners``,
``mbf.costmap_layers``, ``mbf.mesh_layers``, ``mbf.servers``), by ``module:Class``, or registered directly. A type is
first looked for with the backend's prefix: on the backend ``mesh`` the type ``cvp`` is ``mesh.cvp``, and a plugin
that needs no map is found by its bare name on every backend.

Nothing is imported before it is asked for.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterable
from importlib.metadata import EntryPoint
from pathlib import Path

from mbf_abstract.config.findings import suggest
from mbf_abstract.config.installed_plugins import GROUPS, PluginEntry, entry_of, origin_of, points_of
from mbf_abstract.event_values import error_text
from mbf_abstract.parameters import ParameterModel, PluginParameters
from mbf_abstract.plugins import PLUGIN_BASES, PluginKind

Adapter = Callable[[str, type], type | None]
"""Given a group and a class that is no MBF plugin, return an MBF plugin class that wraps it, or None."""


class PluginError(Exception):
    """A plugin type cannot be used; see ``group``, ``type`` and ``reason``."""

    def __init__(self, group: str, type_name: str, reason: str) -> None:
        super().__init__(f"{group}: {type_name}: {reason}")
        self.group = group
        self.type = type_name
        self.reason = reason

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Survive pickling, for the return from a worker process."""
        return type(self), (self.group, self.type, self.reason)


class PluginRegistry:
    """Resolves plugin types for one backend.

    Parameters
    ----------
    backend : str
        Prefix that is tried first; empty to find only full names.
    allow_module_types : bool
        Whether ``module:Class`` may import any module of the Python path. Switch it off for untrusted configurations.
    adapters : iterable of Adapter
        Asked, in order, about a class that does not derive from the interface of its group.
    misfit : callable, optional
        Why a class cannot be used on this backend, whatever it derives from; empty if it can.
    """

    def __init__(
        self,
        backend: str = "",
        *,
        allow_module_types: bool = True,
        adapters: Iterable[Adapter] = (),
        misfit: Callable[[type], str] = lambda _: "",
    ) -> None:
        self.backend = backend
        self.allow_module_types = allow_module_types
        self.adapters = list(adapters)
        self._misfit = misfit
        self._registered: dict[tuple[str, str], type] = {}
        self._found: dict[str, dict[str, list[EntryPoint]]] = {}

    def register(self, group: PluginKind | str, name: str, plugin_class: type) -> None:
        """Make ``plugin_class`` known under ``name``; it takes precedence over an entry point of the same name."""
        self._registered[_group(group), name] = plugin_class

    def names(self, group: PluginKind | str) -> list[str]:
        """Return the type names this backend can use, sorted, without its prefix."""
        prefix = f"{self.backend}."
        known = self._known(_group(group))
        return sorted({name.removeprefix(prefix) for name in known if name.startswith(prefix) or "." not in name})

    def load(self, group: PluginKind | str, type_name: str, base: type | None = None) -> type:
        """Return the class of a type.

        Parameters
        ----------
        group : PluginKind or str
            Kind of the plugin, or a group name such as ``"mesh_layers"``.
        type_name : str
            Short name, full name or ``module:Class``.
        base : type, optional
            What the class must derive from; the interface of the kind if not given.

        Raises
        ------
        PluginError
            Unknown type, name clash, import error, wrong base class or missing methods.
        """
        group_name = _group(group)
        return self._checked(group_name, type_name, self._import(group_name, type_name), base)

    def module_of(self, group: PluginKind | str, type_name: str) -> str:
        """Return the name of the module that a type's class stands in, also where an adapter wraps the class.

        Raises PluginError as ``load`` does.
        """
        return str(getattr(self._import(_group(group), type_name), "__module__", ""))

    def reload(self, group: PluginKind | str, type_name: str, base: type | None = None) -> type:
        """Load a type again from its changed source; objects of the old class keep their old code."""
        if (name := self._resolve(_group(group), type_name)) and (_group(group), name) in self._registered:
            return self.load(group, type_name, base)
        module = sys.modules[self.load(group, type_name, base).__module__]
        try:
            importlib.reload(module)
        except (Exception, SystemExit) as error:  # a module may call sys.exit()
            raise PluginError(_group(group), type_name, f"reload failed: {import_problem(error)}") from error
        return self.load(group, type_name, base)

    def entries(self) -> list[PluginEntry]:
        """Import every known plugin and list all of them, those that fail with the error."""
        return [self.entry(group, name) for group in GROUPS for name in sorted(self._known(group))]

    def entry(self, group: str, name: str) -> PluginEntry:
        """Import a known plugin, by its full name, and list it, with the error if that fails."""
        try:
            plugin_class = self._import_known(group, name)
            self._checked(group, name, plugin_class, None)
            reason = None
        except PluginError as error:
            reason = error.reason
        registered = self._registered.get((group, name))
        if registered is None:
            return entry_of(group, self._entry_points(group)[name], reason)
        return PluginEntry(name, group, f"{registered.__module__}:{registered.__qualname__}", "registered", reason)

    def _import(self, group: str, type_name: str) -> object:
        if ":" in type_name:
            return self._import_module_type(group, type_name)
        name = self._resolve(group, type_name)
        if name is None:
            known = self.names(group)
            listed = f"known types: {', '.join(known)}" if known else "no plugin of this kind is installed"
            reason = " ".join(part for part in ("unknown type;", suggest(type_name, known), listed) if part)
            raise PluginError(group, type_name, reason)
        return self._import_known(group, name)

    def _resolve(self, group: str, type_name: str) -> str | None:
        known = self._known(group)
        candidates = (f"{self.backend}.{type_name}", type_name)
        return next((name for name in candidates if name in known), None)

    def _import_known(self, group: str, name: str) -> object:
        registered = self._registered.get((group, name))
        if registered is not None:
            return registered
        points = self._entry_points(group)[name]
        if len({point.value for point in points}) > 1:
            clash = " and ".join(f"{point.value} ({origin_of(point)})" for point in points)
            raise PluginError(group, name, f"name clash between {clash}; use module:Class")
        try:
            return points[0].load()
        except (Exception, SystemExit) as error:
            raise PluginError(group, name, f"import failed: {import_problem(error)}") from error

    def _import_module_type(self, group: str, type_name: str) -> object:
        if not self.allow_module_types:
            raise PluginError(group, type_name, "module:Class types are switched off (allow_module_types)")
        module_name, _, class_name = type_name.partition(":")
        try:
            return getattr(importlib.import_module(module_name), class_name)
        except (Exception, SystemExit) as error:
            raise PluginError(group, type_name, f"import failed: {import_problem(error)}") from error

    def _checked(self, group: str, type_name: str, plugin_class: object, base: type | None) -> type:
        if not isinstance(plugin_class, type):
            raise PluginError(group, type_name, f"is not a class but a {type(plugin_class).__name__}")
        expected = base or _BASES.get(group, object)
        if issubclass(plugin_class, expected):
            if missing := sorted(getattr(plugin_class, "__abstractmethods__", ())):
                raise PluginError(group, type_name, f"does not implement {', '.join(missing)}")
            if reason := self._misfit(plugin_class) or _wrong_parameters(plugin_class):
                raise PluginError(group, type_name, reason)
            return plugin_class
        for adapter in self.adapters:
            adapted = adapter(group, plugin_class)
            if adapted is not None:
                return adapted
        raise PluginError(group, type_name, f"class {plugin_class.__qualname__} is no {expected.__qualname__}")

    def _known(self, group: str) -> set[str]:
        return {name for of_group, name in self._registered if of_group == group} | set(self._entry_points(group))

    def _entry_points(self, group: str) -> dict[str, list[EntryPoint]]:
        if group not in self._found:
            self._found[group] = points_of(group)
        return self._found[group]


_BASES: dict[str, type] = {kind.value: base for kind, base in PLUGIN_BASES.items()}


def _group(group: PluginKind | str) -> str:
    return group.value if isinstance(group, PluginKind) else group


def _wrong_parameters(plugin_class: type) -> str:
    """What is wrong with the class that holds a plugin's parameters, if it has one; empty if nothing is."""
    model: object = getattr(plugin_class, "Parameters", PluginParameters)
    if isinstance(model, type) and issubclass(model, ParameterModel):
        return ""
    return f"its Parameters is {model!r}, expected a class that derives PluginParameters"


def import_problem(error: BaseException) -> str:
    """What an import raised, and what helps where the module lies in the folder in which the program was started."""
    text = f"{type(error).__name__}: {error_text(error)}"
    if isinstance(error, ModuleNotFoundError) and error.name and Path(f"{error.name}.py").is_file():
        return f"{text}; {error.name}.py lies here, but not on the Python path: set PYTHONPATH=. or install it"
    return text
