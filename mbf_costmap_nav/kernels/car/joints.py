"""Curves that join the two trees of hybrid A*, to the root of the other and where they meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, inner_kernel, kernel
from mbf_costmap_nav.kernels.car.curves import curve_between
from mbf_costmap_nav.kernels.car.ground import Ground
from mbf_costmap_nav.kernels.car.motion_primitives import (
    FORWARD_SIDE,
    Car,
    curve_cost,
    direction_of,
)
from mbf_costmap_nav.kernels.car.state_tree import StateTree, best_state
from mbf_costmap_nav.kernels.search.lazy_field import BUCKET, WAITING, LazyField, field_cost
from mbf_costmap_nav.kernels.search.padded_grid import octile_distance
from mbf_costmap_nav.kernels.search.search_cells import Records

FloatArray = NDArray[np.float64]


HEADINGS = 72


CURVE_RANGE = 3.0
"""Beyond this many turning radii the free curve adds little to the heuristic and is not computed."""


ANCESTORS = (1, 2, 4, 8, 16)
"""How many arcs before and behind a meeting of the trees a curve is tried to join them."""


MEETINGS_PER_TRY = 8


class Target(NamedTuple):
    """What a tree grows to.

    Attributes
    ----------
    pose : (3,) float64
        Of the other root.
    records, progress, stride, toward : arrays and numbers
        Those of the field of costs [cells] to it.
    fields : list of one LazyField
        The field itself; a list, as a dozen arrays would be handed on with each call.
    """

    pose: FloatArray
    records: Records
    progress: NDArray[np.int64]
    stride: int
    toward: tuple[int, int]
    fields: list[LazyField]


@kernel
def new_target(pose: FloatArray, field: LazyField) -> Target:
    """Target at a pose, with the field of costs from there."""
    toward = field.toward % field.stride, field.toward // field.stride
    return Target(pose, field.records, field.progress, field.stride, toward, [field])


class Joint(NamedTuple):
    """The best path so far: its ``cost`` (1,) [m], its ``states`` (2,) of both trees, the ``word`` (5, 2) between."""

    cost: FloatArray
    states: NDArray[np.int64]
    word: FloatArray


@kernel
def cost_to_go(ground: Ground, pose: FloatArray, target: Target) -> float:
    """The field [m] at the pose's cell."""
    geometry = ground.geometry
    ix, iy = int((pose[0] - geometry[1]) / geometry[0]), int((pose[1] - geometry[2]) / geometry[0])
    x, y = ix + 1, iy + 1
    cell = y * target.stride + x
    cost, lower = target.records[cell].g, target.progress[BUCKET]  # a bucket is at least 1 wide
    rest = octile_distance(abs(x - target.toward[0]), abs(y - target.toward[1]))
    if target.progress[WAITING] > 0 and np.float32(lower) < cost + rest:
        cost = field_cost(target.fields[0], cell)
    return float(cost * geometry[0])


@kernel
def heuristic(ground: Ground, car: Car, side: float, pose: FloatArray, target: Target) -> float:
    """Larger of the field [m] at the pose's cell and the length of the free curve."""
    around = cost_to_go(ground, pose, target)
    if around > CURVE_RANGE * car.radius:
        return around
    ends = (pose, target.pose) if side == FORWARD_SIDE else (target.pose, pose)
    free_curve = np.abs(curve_between(ends[0], ends[1], car.radius, car.reversing)[:, 1]).sum() * car.radius
    return float(max(free_curve, around))


@kernel
def _join(
    ground: Ground, car: Car, side: float, tree: StateTree, other: StateTree, states: tuple[int, int], joint: Joint
) -> None:
    """Try the free curve between a state of a tree and one of the other; keep it if it is the best path so far."""
    first, second = (tree, other) if side == FORWARD_SIDE else (other, tree)
    a, b = states if side == FORWARD_SIDE else (states[1], states[0])
    limit = joint.cost[0] - first.g[a] - second.g[b]
    if limit <= 0.0:
        return
    word = curve_between(first.poses[a], second.poses[b], car.radius, car.reversing)
    before, after = direction_of(Count(first.motions[a])), direction_of(Count(second.motions[b]))
    cost = curve_cost(ground, car, first.poses[a], word, before, after, limit)
    if cost < limit:
        joint.cost[0] = first.g[a] + cost + second.g[b]
        joint.states[0], joint.states[1] = a, b
        joint.word[:] = word


@inner_kernel
def _ancestor(tree: StateTree, state: int, generations: int) -> int:
    """State so many arcs nearer to the root, or the root."""
    for _ in range(generations):
        if tree.parents[state] >= 0:
            state = Count(tree.parents[state])
    return state


@kernel
def try_joints(
    ground: Ground,
    car: Car,
    side: float,
    trees: tuple[StateTree, StateTree],
    target: Target,
    state: int,
    waits: NDArray[np.int64],
    joint: Joint,
) -> None:
    """Try curves to the other root, more often the nearer it is, and to the other tree where it is met.

    ``waits`` (2,): how many states, and how many meetings, to let pass before the next try of either.
    """
    tree, other = trees
    waits[0] -= 1
    if waits[0] <= 0:
        waits[0] = int(heuristic(ground, car, side, tree.poses[state], target) / (2.0 * car.step))
        _join(ground, car, side, tree, other, (state, Count(0)), joint)
    met = best_state(other, tree.bins[state])
    if met < 0:
        return
    waits[1] -= 1
    if waits[1] <= 0:
        waits[1] = MEETINGS_PER_TRY
        for generations in ANCESTORS:
            ends = (_ancestor(tree, state, generations), _ancestor(other, met, generations))
            _join(ground, car, side, tree, other, ends, joint)
