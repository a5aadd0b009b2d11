"""The environment of the outdoor table: a Husky with physics on rough ground among unmapped rocks, on a mesh.

The world is a scenario file. Events of motion and contact go to the log as in ``warehouse_environment``.
"""

from __future__ import annotations

from pathlib import Path

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from terrain.experiments.table1.conditions import Surroundings
from terrain.experiments.table1.plugin_wrappers import SOURCE, wrap_plugins
from terrain.physics.incidents import IncidentKind
from terrain.scenarios.scenario import load_scenario
from terrain.session.session import Session, SessionOptions

OUTDOOR = Path(__file__).with_name("outdoor.yaml")
STANDS_BELOW = 0.05  # m/s; the wheels of a standing robot creep a little on a slope


class OutdoorEnvironment(Session):
    """One scenario with one robot to be navigated.

    Parameters
    ----------
    surroundings : Surroundings
        Only the planner's latency counts: nothing moves here but the robot.
    seed : int
        Of the ground, the rocks, the sensors, the plugins and the planner latencies.

    Attributes
    ----------
    distance : float
        How far the robot has driven [m].
    """

    def __init__(self, scenario_file: Path, surroundings: Surroundings, seed: int) -> None:
        super().__init__(load_scenario(scenario_file), SessionOptions(seed=seed))
        self.distance = 0.0
        self._last: Pose | None = None
        self._moves = False
        self._reported_incidents = 0
        self.loop.on_sample.append(self._report)
        wrap_plugins(self.navigator.server, seed, surroundings.planner_latency)

    def _report(self, time: float, pose: Pose, velocity: Twist) -> None:
        """Log motion and contacts; called ten times a second."""
        self.distance += 0.0 if self._last is None else pose.distance_to(self._last)
        self._last = pose
        if (velocity.speed > STANDS_BELOW) != self._moves:
            self._moves = not self._moves
            self.events.emit(EventKind.CUSTOM, SOURCE, what="motion", moves=self._moves)
        new = self.simulation.incidents[self._reported_incidents :]
        self._reported_incidents += len(new)
        for incident in new:
            if incident.kind is IncidentKind.COLLISION:
                self.events.emit(EventKind.CUSTOM, SOURCE, what="contact", touched="rack", moved="we")
