"""The stage of the outdoor table: a Husky with physics on rough ground, navigated on a mesh, among rocks nobody mapped.

It offers what ``environment.Stage`` offers to a repetition; the world is a scenario file, run by
``terrain.session.session.Session``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from terrain.experiments.table1.conditions import Conditions
from terrain.experiments.table1.plugin_wrappers import SOURCE, wrap_plugins
from terrain.physics.incidents import IncidentKind
from terrain.scenarios.scenario import load_scenario
from terrain.session.session import Session

OUTDOOR = Path(__file__).with_name("outdoor.yaml")
STANDS_BELOW = 0.05  # m/s; the wheels of a standing robot creep a little on a slope


class OutdoorStage:
    """One scenario with one robot to be navigated; see ``stage.Stage`` for the attributes.

    Parameters
    ----------
    scenario_file : Path
    conditions : Conditions
        Only the planner's latency counts: nothing moves here but the robot.
    seed : int
        Of the ground, the rocks, the sensors, the plugins and the planner latencies.
    """

    def __init__(self, scenario_file: Path, conditions: Conditions, seed: int) -> None:
        self._session = Session(load_scenario(scenario_file), seed=seed)
        self.clock, self.events, self.memory = self._session.clock, self._session.events, self._session.memory
        self.digest = self._session.digest
        self.navigator, self.simulation = self._session.navigator, self._session.simulation
        self.on_tick: list[Callable[[float], None]] = []
        self.distance = 0.0
        self._last: Pose | None = None
        self._moves = False
        self._reported_incidents = 0
        wrap_plugins(self.navigator.server, seed, conditions.planner_latency)

    def goals(self) -> list[Pose]:
        """Return the waypoints on the ground."""
        return self._session.goals

    def __enter__(self) -> OutdoorStage:
        self._session.run(self._tick)
        return self

    def __exit__(self, *exc: object) -> None:
        self._session.close()

    def _tick(self, time: float, pose: Pose, speed: float) -> None:
        """Look at the robot, ten times a second."""
        self.distance += 0.0 if self._last is None else pose.distance_to(self._last)
        self._last = pose
        if (speed > STANDS_BELOW) != self._moves:
            self._moves = not self._moves
            self.events.emit(EventKind.CUSTOM, SOURCE, what="motion", moves=self._moves)
        new = self.simulation.incidents[self._reported_incidents :]
        self._reported_incidents += len(new)
        for incident in new:
            if incident.kind is IncidentKind.COLLISION:
                self.events.emit(EventKind.CUSTOM, SOURCE, what="contact", touched="rack", moved="we")
        for listener in self.on_tick:
            listener(self.clock.now())
