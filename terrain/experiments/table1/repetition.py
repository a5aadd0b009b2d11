"""One run of one condition: all waypoints in order, each with a time limit; a function of condition, world and seed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.time.clock import Clock, wall_seconds
from terrain.experiments.table1.conditions import Condition, Executive, Surroundings, make_executive
from terrain.experiments.table1.counting import Tally, count
from terrain.experiments.table1.environments.outdoor_environment import OUTDOOR, OutdoorEnvironment
from terrain.experiments.table1.environments.warehouse_environment import WarehouseEnvironment
from terrain.experiments.table1.environments.world import load_world
from terrain.experiments.table1.plugin_wrappers import SOURCE

Environment = WarehouseEnvironment | OutdoorEnvironment

LEG_TIME_LIMIT = 300.0  # s
TRACK_SPACING = 10  # of the simulation's 20 poses a second every tenth is kept


@dataclass(frozen=True)
class Repetition:
    """What is kept of one run.

    Attributes
    ----------
    recovery_goals : int
        Recovery goals that were started, counted apart from the calls of the behaviours.
    digest : str
        Of all poses, commands and events; equal runs have equal digests.
    track : (n, 2) float64
        Where the robot was [m], two points a second.
    wall_time : float
        [s]; the only number that differs between equal runs.
    """

    tally: Tally
    recovery_goals: int
    digest: str
    track: NDArray[np.float64]
    wall_time: float

    def to_row(self) -> dict[str, object]:
        """Return plain JSON values."""
        track = np.round(self.track, 2).tolist()
        return {
            "tally": asdict(self.tally),
            "recovery_goals": self.recovery_goals,
            "digest": self.digest,
            "track": track,
            "wall_time": self.wall_time,
        }


class _Deadline:
    """Cancels an executive when the time of its leg is over; lives on the simulator's thread."""

    def __init__(self, executive: Executive, clock: Clock) -> None:
        self._executive = executive
        self._clock = clock
        self._stamp = float("inf")
        self.passed = False

    def start(self) -> None:
        """Begin a leg."""
        self._stamp, self.passed = self._clock.now() + LEG_TIME_LIMIT, False

    def stop(self) -> None:
        """End a leg."""
        self._stamp = float("inf")

    def watch(self, time: float, pose: Pose, velocity: Twist) -> None:
        """Check the time; called with each sample of the robot."""
        if not self.passed and self._clock.now() >= self._stamp:
            self.passed = True
            self._executive.cancel("time limit of the leg")


def run_repetition(condition: Condition, world: Path, seed: int, legs: int | None = None) -> Repetition:
    """Drive to the waypoints of a world (the first ``legs`` of them) and count what happened.

    Parameters
    ----------
    world : Path
        A world file, or ``outdoor_environment.OUTDOOR``.
    """
    started = wall_seconds()
    with _open_environment(world, condition.surroundings, seed) as environment:
        return drive(environment, make_executive(condition, environment.navigator), started, legs)


def drive(environment: Environment, executive: Executive, started: float, legs: int | None = None) -> Repetition:
    """Drive to the goals of an environment (the first ``legs`` of them); ``started``: ``wall_seconds()`` before it."""
    deadline = _Deadline(executive, environment.clock)
    environment.loop.on_sample.append(deadline.watch)
    for number, goal in enumerate(environment.goals[:legs]):
        _drive_leg(environment, executive, deadline, number, goal)
    events, digest = environment.memory.events, environment.digest.hexdigest()
    track = np.array([(pose.x, pose.y) for pose in environment.simulation.track[::TRACK_SPACING]])
    recovery_goals = sum(event.kind is EventKind.RECOVERY for event in events)
    return Repetition(count(events), recovery_goals, digest, track, wall_seconds() - started)


def _open_environment(world: Path, surroundings: Surroundings, seed: int) -> Environment:
    if world == OUTDOOR:
        return OutdoorEnvironment(world, surroundings, seed)
    return WarehouseEnvironment(load_world(world), surroundings, seed)


def _drive_leg(environment: Environment, executive: Executive, deadline: _Deadline, number: int, goal: Pose) -> None:
    driven = environment.distance
    deadline.start()
    environment.events.emit(EventKind.CUSTOM, SOURCE, what="leg_started", leg=number)
    result = executive.run(goal)
    deadline.stop()
    end = "reached" if result.success else "timed_out" if deadline.passed else "aborted"
    distance = environment.distance - driven
    environment.events.emit(
        EventKind.CUSTOM, SOURCE, what="leg_ended", leg=number, end=end, distance=distance, message=result.message
    )
