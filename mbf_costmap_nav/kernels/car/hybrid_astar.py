"""Hybrid A*: a search over positions and headings whose steps are arcs a car can drive, from both ends at once.

States are continuous; two of them are the same if they fall into one bin of position and one of ``HEADINGS`` of
heading. One tree grows from the start and one, against the direction of driving, from the goal; the one with fewer open
states is next. So a place that is hard to leave or to enter is worked out near by, not by a search of everything else,
and a goal that cannot be entered is known as soon as the states around it are spent.

The heuristic is the larger of the cost-to-go over the cells, in the measure that arcs are weighed in, and of the free
curve of a car. Curves that join the trees (analytic expansion) are tried from each tree to the root of the other, and
where the trees meet in a bin, between states a little before and behind it.

Formula: Dolgov, Thrun, Montemerlo, Diebel 2010, without its Voronoi field: cells' costs do that here. The order is that
of weighted A* (Pohl 1970), the choice of the side Pohl's (1971).
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, inner_kernel, kernel
from mbf_costmap_nav.kernels.car.curves import sample_word
from mbf_costmap_nav.kernels.car.ground import Ground, driven_cost
from mbf_costmap_nav.kernels.car.joints import (
    HEADINGS,
    FloatArray,
    Joint,
    Target,
    cost_to_go,
    heuristic,
    new_target,
    try_joints,
)
from mbf_costmap_nav.kernels.car.motion_primitives import (
    BACKWARD_SIDE,
    FORWARD_MOTIONS,
    FORWARD_SIDE,
    MOTIONS,
    NO_MOTION,
    Car,
    change_of,
    direction_of,
    path_from_root,
    sample_arc,
    steering_of,
    weight_of,
)
from mbf_costmap_nav.kernels.car.state_tree import StateTree, best_state, new_tree, with_state
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, EXHAUSTED, FOUND
from mbf_costmap_nav.kernels.search.lazy_field import FieldMemory, new_field

Heap = list[tuple[float, int]]

GAVE_UP, NEARBY = 3, 4
"""Further states of a finished search: the limit of states was met; a state within the tolerance was taken."""

HEURISTIC_WEIGHT = 1.5
"""The cost of the arcs found is within about this factor of the best; the fewer states, the larger it is."""
WORTH_WHILE = 1.1
"""A state replaces the one in its bin only if it is better by this factor; half of all states are spared."""
SPARE_STATES = 500
"""With a path known, the search for a better one goes on for half of the states so far, and these."""


@inner_kernel
def _bin_of(ground: Ground, car: Car, pose: FloatArray) -> int:
    """Number of the state's bin."""
    geometry = ground.geometry
    ix, iy = int((pose[0] - geometry[1]) / car.bin_size), int((pose[1] - geometry[2]) / car.bin_size)
    heading = int(np.floor(pose[2] / (2.0 * np.pi) * HEADINGS + 0.5)) % HEADINGS
    return ((iy << 28) + ix) * HEADINGS + heading


@kernel
def _grow(
    ground: Ground, car: Car, side: float, tree: StateTree, target: Target, state: int, heap: Heap, arc: FloatArray
) -> StateTree:
    """Add what six arcs (three if the car may not reverse) reach; what no free ground would improve is not looked at.

    ``arc`` (pieces, 3) is working memory. The tree it returns may stand in other memory.
    """
    pose = tree.poses[state]
    for motion in range(MOTIONS if car.reversing else FORWARD_MOTIONS):
        sample_arc(pose, motion, side, car, arc)
        reached, direction = arc[car.pieces - 1], direction_of(motion)
        bin_reached = _bin_of(ground, car, reached)
        known = best_state(tree, bin_reached)
        g_known = tree.g[known] / WORTH_WHILE if known >= 0 else np.inf
        g_before = tree.g[state] + change_of(car, direction_of(Count(tree.motions[state])), direction)
        free_cost = car.step * weight_of(car, steering_of(motion), direction)
        if g_known <= g_before + free_cost:
            continue
        cost = driven_cost(ground, pose, arc)
        g_new = g_before + free_cost * (1.0 + car.cost_factor * cost / 252.0)
        if cost < 0.0 or g_known <= g_new:
            continue
        estimate = heuristic(ground, car, side, reached, target)
        if estimate < np.inf:
            heapq.heappush(heap, (g_new + HEURISTIC_WEIGHT * estimate, tree.made[0]))
            tree = with_state(tree, reached, g_new, bin_reached, state, motion)
    return tree


@inner_kernel
def _nearest_state(tree: StateTree, goal: FloatArray, tolerance: float) -> int:
    """Nearest state of a tree to the goal, within ``tolerance`` [m] and half a heading bin; or -1."""
    best, nearest = tolerance, -1
    for i in range(tree.made[0]):
        distance = np.hypot(tree.poses[i, 0] - goal[0], tree.poses[i, 1] - goal[1])
        turn = abs((tree.poses[i, 2] - goal[2] + np.pi) % (2.0 * np.pi) - np.pi)
        if distance <= best and turn <= np.pi / HEADINGS:
            best, nearest = distance, i
    return nearest


@kernel
def _nearest_to_target(ground: Ground, tree: StateTree, target: Target) -> FloatArray:
    """Place (2,) [m] of the state of a tree from which the centre alone has least left to drive."""
    best, least = 0, np.inf
    for i in range(tree.made[0]):
        left = cost_to_go(ground, tree.poses[i], target)
        if left < least:
            best, least = i, left
    return tree.poses[best, :2].copy()


@kernel
def hybrid_search(
    ground: Ground,
    car: Car,
    ends: tuple[FloatArray, FloatArray],
    cells: tuple[int, int],
    memory: tuple[FieldMemory, FieldMemory],
    wanted: FloatArray,
    tolerance: float,
    max_states: int,
    cancel_flag: NDArray[np.uint8],
) -> tuple[int, FloatArray, float, int, FloatArray]:
    """Search a path from the start to the goal.

    Parameters
    ----------
    ends : two of (3,) float64
        Poses of the start and of the goal.
    cells : two int
        Flat padded indices of their cells.
    memory : two FieldMemory
        For the field of costs from the start, and for that from the goal.
    wanted : (3,) float64
    tolerance : float
        If the goal is not reached, the state nearest to ``wanted`` that can be, at most so far [m] away and of its
        heading, will do; 0 = none will.
    max_states : int
        Give up after so many states of both trees.

    Returns
    -------
    status : int
        FOUND (the path ends at the goal), NEARBY (within the tolerance of ``wanted``), EXHAUSTED, GAVE_UP or CANCELED.
    poses : (m, 3) float64
        From the start to the end, at most the resolution apart.
    cost : float
        Of the path [m], weighted.
    states : int
        How many were made.
    stuck : (2,) float64
        Without a path, where [m] the smaller of both trees came nearest to the other root, as the centre would drive.
    """
    (start, goal), (first, last_cell) = ends, cells
    from_goal = new_target(start, new_field(memory[0], first, last_cell, cancel_flag))
    from_start = new_target(goal, new_field(memory[1], last_cell, first, cancel_flag))
    tree = new_tree(start, _bin_of(ground, car, start), Count(NO_MOTION))
    other = new_tree(goal, _bin_of(ground, car, goal), Count(NO_MOTION))
    heap, other_heap = [(0.0, 0)], [(0.0, 0)]
    waits, other_waits = np.zeros(2, dtype=np.int64), np.zeros(2, dtype=np.int64)
    joint = Joint(np.full(1, np.inf), np.zeros(2, dtype=np.int64), np.zeros((5, 2)))
    arc, nothing = np.empty((car.pieces, 3)), np.empty((0, 3))
    status, last_count = EXHAUSTED, max_states
    while len(heap) > 0 and (len(other_heap) > 0 or tolerance > 0.0):
        count = tree.made[0] + other.made[0]
        if cancel_flag[0] != 0:
            return CANCELED, nothing, 0.0, count, start[:2].copy()
        # 1. With a path at hand, stop when none of the open states promises a better one, or it took long enough.
        if joint.cost[0] < np.inf:
            last_count = min(last_count, count + count // 2 + SPARE_STATES)
            most_promising = max(heap[0][0], other_heap[0][0]) if len(other_heap) > 0 else heap[0][0]
            if joint.cost[0] <= most_promising:
                break
        if count >= last_count:
            status = GAVE_UP
            break
        # 2. The smaller side is next.
        if len(other_heap) == 0 or len(heap) <= len(other_heap):
            state = heapq.heappop(heap)[1]
            if best_state(tree, tree.bins[state]) == state:
                try_joints(ground, car, FORWARD_SIDE, (tree, other), from_start, state, waits, joint)
                tree = _grow(ground, car, FORWARD_SIDE, tree, from_start, state, heap, arc)
        else:
            state = heapq.heappop(other_heap)[1]
            if best_state(other, other.bins[state]) == state:
                try_joints(ground, car, BACKWARD_SIDE, (other, tree), from_goal, state, other_waits, joint)
                other = _grow(ground, car, BACKWARD_SIDE, other, from_goal, state, other_heap, arc)

    # 3. The arcs from the start, the curve, the arcs to the goal; without a path the state within the tolerance.
    count = tree.made[0] + other.made[0]
    if joint.cost[0] < np.inf:
        a, b = joint.states
        pose = tree.poses[a]
        curve = sample_word(pose[0], pose[1], pose[2], joint.word, car.radius, ground.geometry[0])
        behind = path_from_root(other, b, BACKWARD_SIDE, car)[::-1]
        path = np.concatenate((path_from_root(tree, a, FORWARD_SIDE, car), curve, behind[1:]))
        return FOUND, path, joint.cost[0], count, goal[:2].copy()
    last = _nearest_state(tree, wanted, tolerance) if tolerance > 0.0 else -1
    if tree.made[0] <= other.made[0]:
        stuck = _nearest_to_target(ground, tree, from_start)
    else:
        stuck = _nearest_to_target(ground, other, from_goal)
    if last < 0:
        return status, nothing, 0.0, count, stuck
    return NEARBY, path_from_root(tree, last, FORWARD_SIDE, car), tree.g[last], count, stuck
