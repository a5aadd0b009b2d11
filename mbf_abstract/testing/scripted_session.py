"""A session for tests: a server without a map, a loopback robot and scripted plugins on one clock, made in one line.

Example
-------
>>> with ScriptedSession(controller_patience=1.0) as session:
...     session.planner.play(RuntimeError("boom"))
...     result = session.navigator.get_path(Pose.planar(3.0, 0.0))
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any, TypeVar

import numpy as np

from mbf_abstract.config.configuration import Config, PluginSpec
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.drive.robot import Robot
from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.maps.map_queries import MapQueries
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.plugins import PLUGIN_BASES, Plugin, PluginContext, PluginKind
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, ScriptedRefiner
from mbf_abstract.time.clock import Clock

P = TypeVar("P", bound=Plugin)

SCRIPTED: dict[str, type[Plugin]] = {
    "planner": ScriptedPlanner,
    "controller": ScriptedController,
    "recovery": ScriptedRecovery,
    "refiner": ScriptedRefiner,
}


class MapFreeServer(AbstractNavigationServer):
    """A server without a map, for plugins that need none. ``map_trouble`` is what it answers as ``map_problem``."""

    backend = "none"
    map_trouble = ""

    def load_map(self, config: Config) -> None:
        """Do nothing."""

    def make_context(self, kind: PluginKind, options: Mapping[str, Any], base: PluginContext) -> PluginContext:
        """Return the context unchanged."""
        return base

    @property
    def queries(self) -> MapQueries:
        """None; raises NotImplementedError."""
        raise NotImplementedError("a server without a map answers no questions about it")

    def take_scan(self, scan: RangeScan) -> None:
        """Show it to those who listen; there is no map to take it."""
        for listener in self.scan_listeners:
            listener(scan)

    def map_problem(self) -> str:
        """Return ``map_trouble``."""
        return self.map_trouble


class ScriptedSession(LoopbackSession):
    """A loopback robot and a server of scripted plugins.

    Parameters
    ----------
    plugins : mapping of str to type, optional
        Plugin classes by name; one scripted plugin of each kind if not given.
    clock : Clock, optional
        A new ``SimClock`` if not given.
    start : Pose
        Where the robot stands.
    robot : Robot, optional
        Another driver in front of the loopback robot, e.g. one that raises.
    **parameters
        Navigation parameters that differ from their defaults.
    """

    def __init__(
        self,
        plugins: Mapping[str, type[Plugin]] | None = None,
        clock: Clock | None = None,
        start: Pose | None = None,
        robot: Robot | None = None,
        **parameters: Any,
    ) -> None:
        super().__init__(start or Pose.planar(0.0, 0.0), clock)
        specs = [_spec(name, plugin_class) for name, plugin_class in (plugins or SCRIPTED).items()]
        config = Config("none", FilePath("scripted.yaml"), NavigationParameters(**parameters), tuple(specs))
        self.server = self.serve(MapFreeServer, config, robot or self.robot, self.transforms)

    @property
    def planner(self) -> ScriptedPlanner:
        """The scripted planner."""
        return self.plugin("planner", ScriptedPlanner)

    @property
    def controller(self) -> ScriptedController:
        """The scripted controller."""
        return self.plugin("controller", ScriptedController)

    @property
    def recovery(self) -> ScriptedRecovery:
        """The scripted recovery behaviour."""
        return self.plugin("recovery", ScriptedRecovery)

    @property
    def refiner(self) -> ScriptedRefiner:
        """The scripted refiner."""
        return self.plugin("refiner", ScriptedRefiner)

    def plugin(self, name: str, plugin_class: type[P]) -> P:
        """Return the instance of a loaded plugin; raises KeyError if there is none of this name and class."""
        for kind in PluginKind:
            found = self.server.plugins.find(kind, name)
            if found is not None and isinstance(found.instance, plugin_class):
                return found.instance
        raise KeyError(f"no {plugin_class.__name__} named {name!r}")

    def recorded(self, *kinds: EventKind) -> tuple[Event, ...]:
        """Return what was recorded, of these kinds only."""
        return self.memory.of_kind(*kinds)

    def path_to(self, x: float, y: float = 0.0) -> Path:
        """Return a straight path from the robot to a point, with a pose every 0.1 m at most."""
        start = self.robot.pose
        count = max(2, int(start.distance_to(Pose.planar(x, y)) / 0.1) + 1)
        return Path.from_points(np.linspace(start.position, (x, y, start.z), count))


def _spec(name: str, plugin_class: type[Plugin]) -> PluginSpec:
    kind = next(kind for kind, base in PLUGIN_BASES.items() if issubclass(plugin_class, base))
    return PluginSpec(kind, name, plugin_class.__name__, plugin_class, plugin_class.Parameters())
