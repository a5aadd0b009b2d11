"""One run of one arm: all waypoints in order, each with its time limit; a function of (arm, world, seed)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.time.clock import wall_seconds
from terrain.experiments.table1.conditions import Arm, Conditions, Executive, make_executive
from terrain.experiments.table1.counting import Tally, count
from terrain.experiments.table1.environments.outdoor_environment import OUTDOOR, OutdoorStage
from terrain.experiments.table1.environments.warehouse_environment import Stage
from terrain.experiments.table1.environments.world import load_world
from terrain.experiments.table1.plugin_wrappers import SOURCE

LEG_TIME_LIMIT = 300.0  # s
TRACK_SPACING = 10  # of the simulation's 20 poses a second every tenth is kept


@dataclass(frozen=True)
class Repetition:
    """What is kept of one run.

    Attributes
    ----------
    tally : Tally
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

    def __init__(self) -> None:
        self.executive: Executive | None = None
        self.stamp = float("inf")
        self.passed = False

    def __call__(self, now: float) -> None:
        if self.executive is not None and not self.passed and now >= self.stamp:
            self.passed = True
            self.executive.cancel("time limit of the leg")


def run_repetition(arm: Arm, world: Path, seed: int, legs: int | None = None) -> Repetition:
    """Drive to the waypoints of a world (the first ``legs`` of them) and count what happened.

    Parameters
    ----------
    world : Path
        A world file, or ``outdoor_stage.OUTDOOR``.
    """
    started = wall_seconds()
    with _open_stage(world, arm.conditions, seed) as stage:
        executive = make_executive(arm, stage.navigator)
        deadline = _Deadline()
        deadline.executive = executive
        stage.on_tick.append(deadline)
        for number, goal in enumerate(stage.goals()[:legs]):
            _drive_leg(stage, executive, deadline, number, goal)
        events, digest = stage.memory.events, stage.digest.hexdigest()
        track = np.array([(pose.x, pose.y) for pose in stage.simulation.track[::TRACK_SPACING]])
    recovery_goals = sum(event.kind is EventKind.RECOVERY for event in events)
    return Repetition(count(events), recovery_goals, digest, track, wall_seconds() - started)


def _open_stage(world: Path, conditions: Conditions, seed: int) -> Stage | OutdoorStage:
    if world == OUTDOOR:
        return OutdoorStage(world, conditions, seed)
    return Stage(load_world(world), conditions, seed)


def _drive_leg(stage: Stage | OutdoorStage, executive: Executive, deadline: _Deadline, number: int, goal: Pose) -> None:
    driven = stage.distance
    deadline.stamp, deadline.passed = stage.clock.now() + LEG_TIME_LIMIT, False
    stage.events.emit(EventKind.CUSTOM, SOURCE, what="leg_started", leg=number)
    result = executive.run(goal)
    deadline.stamp = float("inf")
    end = "reached" if result.success else "timed_out" if deadline.passed else "aborted"
    distance = stage.distance - driven
    stage.events.emit(
        EventKind.CUSTOM, SOURCE, what="leg_ended", leg=number, end=end, distance=distance, message=result.message
    )
