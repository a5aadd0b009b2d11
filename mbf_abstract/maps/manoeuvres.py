"""The shortest manoeuvre to a place with a property, over any map: forward, backward, in curves, turning on the spot.

When to use: a few metres in a recovery, where driving backward is as good as forward and the outline of the robot
matters at every pose, such as out of the way of another robot. When not: plans; a planner is faster by orders of
magnitude and knows costs.

A* over places of 0.15 m and headings of 22.5 degrees. Only poses that are free are entered, all along each step. Each
state keeps the exact pose of its shortest manoeuvre, so steps join without gaps. Cost: 0.07 s a thousand states on a
costmap, 0.15 s on a mesh; a corridor of one robot's width has a few hundred states a metre.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.kernels.steps import steps_from
from mbf_abstract.maps.queries import PlanarPose

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


class _State(NamedTuple):
    """Where a manoeuvre leads: its cost, its end and what is left there, its last step and the state before."""

    cost: float
    pose: PlanarPose
    key: tuple[int, int, int]
    left: float
    kind: Step | None
    poses: FloatArray
    before: _State | None


def find_manoeuvre(
    fits: Callable[[FloatArray], NDArray[np.bool_]],
    left: Callable[[FloatArray], FloatArray],
    most: float,
    turning_radius: float = 0.0,
    is_canceled: Callable[[], bool] = lambda: False,
) -> list[Step] | None:
    """Find the shortest manoeuvre from the origin, heading along x, to a pose with nothing left to drive.

    Parameters
    ----------
    fits : callable
        Whether the robot may stand (n,) at poses (n, 3); not asked about the origin.
    left : callable
        How far [m] (n,) it is from poses (n, 3) to the nearest place to end at, at least; 0 there.
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
    kinds, origin = kinds_of_steps(turning_radius), np.zeros((1, 3))
    steps, settled = _aligned(kinds), set[tuple[int, int, int]]()
    start = _State(0.0, (0.0, 0.0, 0.0), (0, 0, 0), float(left(origin)[0]), None, origin, None)
    queue, count = [(0.0, 0, start)], 0
    while queue and len(settled) < MOST_STATES and not is_canceled():
        _, _, state = heapq.heappop(queue)
        if state.key in settled:
            continue
        settled.add(state.key)
        if state.left <= 0.0:
            return _steps_to(state)
        for following in _states_after(state, kinds, steps_from(*state.pose, steps), settled, left, most, fits):
            count += 1  # of states that promise the same the older one is looked at first
            heapq.heappush(queue, (following.cost + following.left, count, following))
    return None


def _states_after(
    state: _State,
    kinds: list[Step],
    poses: FloatArray,
    settled: set[tuple[int, int, int]],
    left: Callable[[FloatArray], FloatArray],
    most: float,
    fits: Callable[[FloatArray], NDArray[np.bool_]],
) -> Iterator[_State]:
    """Yield the states after one step of each kind, along poses (k, m, 3), that are new, free, and near enough."""
    ends, keys = poses[:, -1], _keys(poses[:, -1])
    costs = [state.cost + kind.cost + _gear_change(state.kind, kind) for kind in kinds]
    new = [index for index, key in enumerate(keys) if key not in settled]
    lefts = dict(zip(new, left(ends[new]).tolist(), strict=True)) if new else {}
    near = [index for index, rest in lefts.items() if costs[index] + rest <= most]
    for index in _free(poses, near, fits):
        x, y, yaw = ends[index].tolist()
        yield _State(costs[index], (x, y, yaw), keys[index], lefts[index], kinds[index], poses[index], state)


def _free(poses: FloatArray, steps: list[int], fits: Callable[[FloatArray], NDArray[np.bool_]]) -> list[int]:
    """Those of some steps, of poses (k, m, 3), all poses of which are free; the ends, which many are not at, first."""
    for part in (poses[:, -1:], poses[:, :-1]):
        if steps:
            free = fits(part[steps].reshape(-1, 3)).reshape(len(steps), -1)
            steps = [step for step, are_free in zip(steps, free.tolist(), strict=True) if all(are_free)]
    return steps


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


def _aligned(kinds: list[Step]) -> FloatArray:
    """Poses (k, m, 3) of steps from the origin; shorter steps stay at their end."""
    most = max(len(kind.poses) for kind in kinds)
    return np.array([[*kind.poses, *[kind.poses[-1]] * (most - len(kind.poses))] for kind in kinds])


def _keys(poses: FloatArray) -> list[tuple[int, int, int]]:
    """States of poses (n, 3)."""
    cells = np.rint(poses / (CELL, CELL, HEADING)).astype(np.int64)
    cells[:, 2] %= HEADINGS
    return [(column, row, heading) for column, row, heading in cells.tolist()]


def _steps_to(state: _State) -> list[Step]:
    steps: list[Step] = []
    at: _State | None = state
    while at is not None and at.kind is not None:
        poses = tuple((x, y, yaw) for x, y, yaw in at.poses[: len(at.kind.poses)].tolist())
        steps.append(Step(at.kind.gear, poses, at.kind.cost))
        at = at.before
    return steps[::-1]
