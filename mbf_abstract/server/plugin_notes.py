"""Notes of a server, each a sentence for the user: what was found in its maps, settings of plugins that do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mbf_abstract.actions.meetings import own_distance
from mbf_abstract.config.configuration import Config
from mbf_abstract.config.implausible import implausible_values
from mbf_abstract.event_bus import EventBus
from mbf_abstract.events import Event, EventKind
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.maps.map_plugin import MapPlugin
from mbf_abstract.plugins import AbstractPlanner, PluginKind
from mbf_abstract.server.plugin_table import PluginTable


class MapNotes:
    """What was reported of the maps that are served now and not withdrawn since, as notes, each once."""

    def __init__(self, events: EventBus) -> None:
        self._events = events
        self._outdated: tuple[Event, ...] = ()

    def __iter__(self) -> Iterator[str]:
        notes = dict[str, None]()
        for event in self._reported():
            if any(event is old for old in self._outdated):
                continue
            if "withdrawn" in event.data:
                notes.pop(str(event.data["withdrawn"]), None)
            else:
                notes[str(event.data.get("message", ""))] = None
        yield from notes

    def forget(self) -> None:
        """Leave out what has been reported until now: the map of that is no longer there."""
        self._outdated = self._reported()

    def _reported(self) -> tuple[Event, ...]:
        kept = self._events.memory
        return kept.of_kind(EventKind.MAP) if kept else ()


def notes_on_numbers(config: Config, plugins: PluginTable, runtime: Runtime) -> Iterator[str]:
    """Yield a note for every number of the server, its plugins, maps and layers that is hardly in the right unit."""
    yield from implausible_values(runtime.parameters)
    for kind in PluginKind:
        for plugin in plugins.all_of(kind):
            yield from implausible_values(plugin.instance.parameters, f"{kind.name.lower()} {plugin.name!r}: ")
    for name, section in config.sections.items():
        yield from implausible_values(section.parameters, f"{name}: ")
        for layer in section.layers:
            yield from implausible_values(layer.parameters, f"{name}: layer {layer.name!r}: ")


def notes_on_plugins(plugins: PluginTable, runtime: Runtime, car_controllers: Sequence[str]) -> Iterator[str]:
    """Yield a note for every setting that can not work as it is; the controllers are those of the map for cars."""
    yield from _curve_notes(plugins, runtime.gate.limits.min_turning_radius, car_controllers)
    yield from _prediction_notes(plugins)
    yield from _right_of_way_notes(plugins, runtime)


def _curve_notes(plugins: PluginTable, tightest: float, car_controllers: Sequence[str]) -> Iterator[str]:
    """Plugins whose curves are tighter than the robot's radius [m]."""
    for kind in (PluginKind.PLANNER, PluginKind.CONTROLLER):
        for plugin in plugins.all_of(kind):
            name = f"{kind.name.lower()} {plugin.name!r}"
            radius = getattr(plugin.instance.parameters, "min_turning_radius", None)
            if radius is not None and 0.0 < radius < tightest:
                yield f"{name}: min_turning_radius {radius:g} m is tighter than the robot's {tightest:.2f} m"
            if tightest > 0.0 and getattr(plugin.instance, "turns_on_the_spot", False):
                suited = f"; {' or '.join(car_controllers)} suits it" if car_controllers else ""
                spot = f"{name} turns on the spot, which the robot cannot"
                yield f"{spot}: its tightest curve is {tightest:.2f} m{suited}"


def _prediction_notes(plugins: PluginTable) -> Iterator[str]:
    """Planners for which it is an obstacle where somebody will be: they plan far around who is gone by then."""
    for plugin in plugins.all_of(PluginKind.PLANNER):
        planner = plugin.instance
        if not isinstance(planner, AbstractPlanner) or not isinstance(planner, MapPlugin):
            continue
        share = planner.avoided_share
        for name, layer in planner.navigation_map.layers.items():
            cost = getattr(layer.parameters, "prediction_cost", 0.0)
            if cost >= share:
                yield (
                    f"planner {plugin.name!r}: what costs {share:.2g} of an obstacle is one for it, and layer {name!r} "
                    f"has prediction_cost {cost:g}: it plans no path through where somebody will be, however long "
                    "another one is; a prediction_cost below that lets it"
                )


def _right_of_way_notes(plugins: PluginTable, runtime: Runtime) -> Iterator[str]:
    """Whether robots meet that the behaviour for it does not see: both would pull out."""
    distance, seen = runtime.parameters.right_of_way_distance, own_distance(runtime, plugins)
    if distance is not None and seen is not None and seen < distance:
        yield (
            f"right_of_way_distance {distance:g} m is more than the distance {seen:g} m of the behaviour that is "
            "run for it: robots that meet between the two all pull out"
        )
