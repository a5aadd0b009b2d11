"""Wrappers around the plugins of a server that make a run of Table I comparable and countable."""

from __future__ import annotations

import hashlib
import math

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.plugins import (
    AbstractController,
    AbstractPlanner,
    ControlRequest,
    ControlResult,
    PlanRequest,
    PlanResult,
    Plugin,
    PluginContext,
    PluginKind,
)
from mbf_abstract.server.navigation_server import AbstractNavigationServer

QUERY_CELL = 0.5  # m; queries whose starts and goals share these cells take equally long
LATENCY_SPREAD = 0.25  # of the mean, to both sides
SOURCE = "table1"


def hashed_latency(seed: int, start: Pose, goal: Pose, mean: float) -> float:
    """Time [s] a query takes: a function of seed, start cell and goal cell only."""
    cells = [math.floor(value / QUERY_CELL) for value in (start.x, start.y, goal.x, goal.y)]
    digest = hashlib.sha256(repr((seed, *cells)).encode()).digest()
    share = int.from_bytes(digest[:8], "big") / 2.0**64
    return mean * (1.0 + LATENCY_SPREAD * (2.0 * share - 1.0))


class PaddedPlanner(AbstractPlanner):
    """Makes each call of a planner, failing ones included, take its modelled time on the simulation clock."""

    def __init__(self, planner: AbstractPlanner, seed: int, latency: float) -> None:
        super().__init__(_context_of(planner))
        self._planner = planner
        self._seed = seed
        self._latency = latency

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan; the caller then sleeps for ``modelled_compute_time``."""
        self.modelled_compute_time = hashed_latency(self._seed, request.start, request.goal, self._latency)
        return self._planner.make_plan(request)

    def cancel(self) -> bool:
        """Pass on."""
        return self._planner.cancel()


class CountedController(AbstractController):
    """Writes each plan that is handed over, and each cycle, to the event log."""

    def __init__(self, controller: AbstractController, server: AbstractNavigationServer) -> None:
        super().__init__(_context_of(controller))
        self._controller = controller
        self._events = server.runtime.events

    def set_plan(self, path: Path) -> bool:
        """Count a hand-over."""
        self._events.emit(EventKind.CUSTOM, SOURCE, what="set_plan", plugin=self.name, poses=len(path))
        return self._controller.set_plan(path)

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Count a cycle with its outcome."""
        result = self._controller.compute_velocity_commands(request)
        self._events.emit(EventKind.CUSTOM, SOURCE, what="cycle", plugin=self.name, outcome=int(result.outcome))
        return result

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Pass on."""
        return self._controller.is_goal_reached(pose, dist_tolerance, angle_tolerance)

    def cancel(self) -> bool:
        """Pass on."""
        return self._controller.cancel()


def _context_of(plugin: Plugin) -> PluginContext:
    return PluginContext(plugin.name, plugin.parameters, plugin.clock, plugin.rng, plugin.robot)


def wrap_plugins(server: AbstractNavigationServer, seed: int, latency: float) -> None:
    """Put every planner and controller of a server into its wrapper."""
    for planner in server.plugins.all_of(PluginKind.PLANNER):
        planner.instance = PaddedPlanner(planner.instance, seed, latency)
    for controller in server.plugins.all_of(PluginKind.CONTROLLER):
        controller.instance = CountedController(controller.instance, server)
