"""The shortest manoeuvre to a place with a property, over any map: forward, backward, in curves, turning on the spot.

When to use: a few metres in a recovery, where driving backward is as good as forward and the outline of the robot
matters at every pose, such as out of the way of another robot. When not: plans; a planner is faster by orders of
magnitude and knows costs.

A* over places of 0.15 m and headings of 22.5 degrees. Only poses that are free are entered, all along each step. Each
state keeps the exact pose of its shortest manoeuvre, so steps join without gaps. Cost: about 0.1 s a thousand states;
a corridor of one robot's width has a few hundred states a metre.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from mbf_abstract.geometry.arcs import arc_poses

CELL = 0.15  # m; poses of one heading that share a cell are one state
HEADINGS = 16
HEADING = 2.0 * math.pi / HEADINGS  # rad between two headings
STEP = 0.3  # m, of a straight step
LEAST_RADIUS = 0.5  # m, of a curve
CHECKED_EVERY = 0.1  # m along a step
TURN_COST = 0.2  # m that a turn on the spot by one heading counts
GEAR_CHANGE_COST = 0.2  # m
MOST_STATES = 20_000
LEAST_LEFT = 0.01
"""How far [m] it is, at least, from every pose at which a manoeuvre may not end."""

PlanarPose = tuple[float, float, float]
"""x, y [m] and heading [rad] in a plane."""


@dataclass(frozen=True)
class Step:
    """One step of a manoeuvre.

    Attributes
    ----------
    gear : int
        1 = forward, -1 = backward, 0 = a turn on the spot.
    poses : tuple of PlanarPose
        Poses along it, without the one it begins at; the last one is its end.
    cost : float
        Its length [m]; a turn on the spot counts ``TURN_COST``.
    """

    gear: int
    poses: tuple[PlanarPose, ...]
    cost: float

    def begun_at(self, begin: PlanarPose) -> Step:
        """Return the same step from another pose than the origin."""
        x, y, yaw = begin
        c, s = math.cos(yaw), math.sin(yaw)
        moved = [(x + c * ahead - s * left, y + s * ahead + c * left, yaw + turn) for ahead, left, turn in self.poses]
        return Step(self.gear, tuple(moved), self.cost)


class _State(NamedTuple):
    cost: float
    pose: PlanarPose
    step: Step | None
    before: _State | None


def find_manoeuvre(
    is_free: Callable[[PlanarPose], bool],
    left: Callable[[PlanarPose], float],
    most: float,
    turning_radius: float = 0.0,
    is_canceled: Callable[[], bool] = lambda: False,
) -> list[Step] | None:
    """Find the shortest manoeuvre from the origin, heading along x, to a pose with nothing left to drive.

    Parameters
    ----------
    is_free : callable
        Whether the robot may stand at a pose; not asked about the origin.
    left : callable
        How far [m] it is from a pose to the nearest place to end at, at least; 0 there.
    most : float
        Greatest cost [m] of the manoeuvre: its length, and what turns on the spot and changes of gear count.
    turning_radius : float
        Radius [m] of the tightest curve; 0 = the robot turns on the spot, too.
    is_canceled : callable
        Asked once for each state that is looked at.

    Returns
    -------
    list of Step or None
        None if there is no such place, or it was canceled.
    """
    kinds = kinds_of_steps(turning_radius)
    settled: set[tuple[int, int, int]] = set()
    queue, count = [(0.0, 0, _State(0.0, (0.0, 0.0, 0.0), None, None))], 0
    while queue and len(settled) < MOST_STATES and not is_canceled():
        _, _, state = heapq.heappop(queue)
        if _key(state.pose) in settled:
            continue
        settled.add(_key(state.pose))
        if left(state.pose) <= 0.0:
            return _steps_to(state)
        for kind in kinds:
            step = kind.begun_at(state.pose)
            end, cost = step.poses[-1], state.cost + step.cost + _gear_change(state.step, step)
            if _key(end) in settled or cost + left(end) > most or not all(map(is_free, step.poses)):
                continue
            count += 1  # of states that promise the same the older one is looked at first
            heapq.heappush(queue, (cost + left(end), count, _State(cost, end, step, state)))
    return None


def driven_back(steps: Sequence[Step]) -> list[Step]:
    """The same manoeuvre from its end to the origin, in the other gears."""
    begins = [(0.0, 0.0, 0.0), *(step.poses[-1] for step in steps)]
    back = zip(steps, begins, strict=False)
    return [Step(-step.gear, (*step.poses[-2::-1], begin), step.cost) for step, begin in back][::-1]


def radius_beyond(most: float) -> float:
    """Radius [m] of curves no step of which is as short as ``most`` [m], for a robot that must not turn."""
    return 2.0 * most / HEADING


def kinds_of_steps(turning_radius: float) -> list[Step]:
    """Steps from the origin: straight and in curves, forward and backward; turns on the spot at a radius of 0 [m]."""
    radius = max(turning_radius, LEAST_RADIUS)
    steps = [_arc(gear, 0.0, STEP) for gear in (1, -1)]
    steps += [_arc(gear, turn / radius, radius * HEADING) for gear in (1, -1) for turn in (1.0, -1.0)]
    if turning_radius == 0.0:
        steps += [Step(0, ((0.0, 0.0, 0.5 * turn), (0.0, 0.0, turn)), TURN_COST) for turn in (HEADING, -HEADING)]
    return steps


def _arc(gear: int, turn: float, length: float) -> Step:
    """Step of a length [m] along which the heading grows by ``turn`` [rad] a metre."""
    spacing = length / math.ceil(length / CHECKED_EVERY)
    poses = arc_poses((0.0, 0.0, 0.0), float(gear), 0.0, turn, length, spacing)
    return Step(gear, tuple((x, y, yaw) for x, y, yaw in poses.tolist()), length)


def _gear_change(before: Step | None, step: Step) -> float:
    return GEAR_CHANGE_COST if before is not None and step.gear * before.gear < 0 else 0.0


def _key(pose: PlanarPose) -> tuple[int, int, int]:
    x, y, yaw = pose
    return round(x / CELL), round(y / CELL), round(yaw / HEADING) % HEADINGS


def _steps_to(state: _State) -> list[Step]:
    steps: list[Step] = []
    at: _State | None = state
    while at is not None and at.step is not None:
        steps.append(at.step)
        at = at.before
    return steps[::-1]
