"""Hybrid A*: a search over positions and headings whose steps are arcs a car can drive.

States are continuous; two of them are the same if they fall into one cell and one of ``HEADINGS`` heading bins. The
heuristic is the larger of the way around obstacles (a field on the grid from the goal) and the free curve of a car.
Now and then a curve is tried straight to the goal (analytic expansion), which also meets the goal's heading exactly.
Each step is looked at all along, not only where it ends: at a large turning radius it spans many cells.

Formula: Dolgov, Thrun, Montemerlo, Diebel 2010, without its Voronoi field: cells' costs do that here.
"""

from __future__ import annotations

import heapq

import numpy as np
from numba.typed import Dict
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.car_curves import car_curve, sample_word
from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.driven_arcs import (
    FORWARD_MOTIONS,
    MOTIONS,
    direction_of,
    driven_cost,
    path_to,
    sample_arc,
    steering_of,
)
from mbf_costmap_nav.kernels.grid_search import CANCELED, EXHAUSTED, FOUND

GAVE_UP, NEARBY = 3, 4
"""Further states of a finished search: the limit of states was met; a state within the tolerance was taken."""

HEADINGS = 72
CURVE_RANGE = 10.0
"""Beyond this many turning radii the free curve adds nothing to the heuristic and is not computed."""


@kernel
def _curve_to(
    pose: NDArray[np.float64], goal: NDArray[np.float64], radius: float, reversing: bool
) -> NDArray[np.float64]:
    """Word of the free curve from a pose to the goal."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    dx, dy = goal[0] - pose[0], goal[1] - pose[1]
    return car_curve((c * dx + s * dy) / radius, (c * dy - s * dx) / radius, goal[2] - pose[2], reversing)


@kernel
def _heuristic(
    pose: NDArray[np.float64],
    goal: NDArray[np.float64],
    field: NDArray[np.float32],
    geometry: NDArray[np.float64],
    radius: float,
    reversing: bool,
) -> float:
    """Larger of the field [m] at the pose's cell and the length of the free curve; ``field`` is (height, width)."""
    ix = int((pose[0] - geometry[1]) / geometry[0])
    iy = int((pose[1] - geometry[2]) / geometry[0])
    around = float(field[iy, ix] * geometry[0])
    if np.hypot(goal[0] - pose[0], goal[1] - pose[1]) > CURVE_RANGE * radius:
        return around
    free_curve = float(np.abs(_curve_to(pose, goal, radius, reversing)[:, 1]).sum() * radius)
    return free_curve if free_curve > around else around


@kernel
def _bin_of(pose: NDArray[np.float64], geometry: NDArray[np.float64], width: int) -> int:
    """Number of the state's bin: cell and heading."""
    ix = int((pose[0] - geometry[1]) / geometry[0])
    iy = int((pose[1] - geometry[2]) / geometry[0])
    heading = int(np.floor(pose[2] / (2.0 * np.pi) * HEADINGS + 0.5)) % HEADINGS
    return (iy * width + ix) * HEADINGS + heading


@kernel
def _nearest_state(poses: NDArray[np.float64], count: int, goal: NDArray[np.float64], tolerance: float) -> int:
    """Nearest of the first ``count`` states to the goal, within ``tolerance`` [m] and half a heading bin; or -1."""
    best, nearest = tolerance, -1
    for i in range(count):
        distance = np.hypot(poses[i, 0] - goal[0], poses[i, 1] - goal[1])
        turn = abs((poses[i, 2] - goal[2] + np.pi) % (2.0 * np.pi) - np.pi)
        if distance <= best and turn <= np.pi / HEADINGS:
            best, nearest = distance, i
    return nearest


@kernel
def hybrid_search(
    cells: NDArray[np.uint8],
    unknown: int,
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    field: NDArray[np.float32],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    wanted: NDArray[np.float64],
    tolerance: float,
    radius: float,
    reversing: bool,
    penalties: NDArray[np.float64],
    max_states: int,
    cancel_flag: NDArray[np.uint8],
) -> tuple[int, NDArray[np.float64], float, int]:
    """Search from ``start`` to ``goal`` (x, y [m], yaw [rad]).

    Parameters
    ----------
    cells : (height, width) uint8
    unknown : int
        Cost that an unknown cell counts as; 254 to keep out of them.
    geometry : (resolution, origin_x, origin_y)
    samples : (n, 2) float64
        Covering points of the footprint [m].
    field : (height, width) float32
        Grid distance [cells] from the goal around obstacles, inf where there is no way.
    wanted : (3,) float64
    tolerance : float
        If the goal is not reached, the state nearest to ``wanted``, at most so far [m] away and of its heading, will
        do; 0 = none will.
    penalties : (cost factor, reverse factor, change of direction [m], turning factor)
    max_states : int
        Give up after so many states.

    Returns
    -------
    status : int
        FOUND (the path ends at ``goal``), NEARBY (within the tolerance of ``wanted``), EXHAUSTED, GAVE_UP or CANCELED.
    poses : (m, 3) float64
        From the start to the end, at most the resolution apart.
    cost : float
        Weighted length [m] to the last state, and the plain length of the curve behind it.
    states : int
        How many were made.
    """
    width = cells.shape[1]
    step = max(1.5 * geometry[0], 2.0 * np.pi / HEADINGS * radius)  # leaves the cell, turns by a bin at least
    pieces = int(np.ceil(step / geometry[0] - 1e-9))
    arc = np.empty((pieces, 3))
    capacity = 1024
    poses, g = np.empty((capacity, 3)), np.empty(capacity)
    parents, motions = np.empty(capacity, dtype=np.int64), np.empty(capacity, dtype=np.int8)
    poses[0], g[0], parents[0], motions[0] = start, 0.0, -1, 1
    count, until_curve = 1, 0
    best = Dict()
    best[_bin_of(start, geometry, width)] = 0.0
    heap = [(_heuristic(start, goal, field, geometry, radius, reversing), 0)]
    status, last = EXHAUSTED, 0
    curve = np.empty((0, 3))
    while len(heap) > 0:
        _, state = heapq.heappop(heap)
        pose = poses[state].copy()
        if g[state] > best[_bin_of(pose, geometry, width)] + 1e-9:
            continue
        if cancel_flag[0] != 0:
            return CANCELED, curve, 0.0, count
        if count >= max_states:
            status = GAVE_UP
            break

        # 1. Analytic expansion, more often the nearer the goal is.
        until_curve -= 1
        if until_curve <= 0:
            until_curve = int(_heuristic(pose, goal, field, geometry, radius, reversing) / (2.0 * step))
            word = _curve_to(pose, goal, radius, reversing)
            curve = sample_word(pose[0], pose[1], pose[2], word, radius, geometry[0])
            if driven_cost(cells, unknown, geometry, samples, pose, curve) >= 0.0:
                status, last = FOUND, state
                break

        # 2. Six arcs (three forward ones if the car may not reverse); what even free ground would not improve is left
        #    out before it is looked at.
        for motion in range(MOTIONS if reversing else FORWARD_MOTIONS):
            sample_arc(pose, motion, step, radius, arc)
            reached, direction = arc[pieces - 1], direction_of(motion)
            key = _bin_of(reached, geometry, width)
            weight = step * (penalties[1] if direction < 0.0 else 1.0)
            weight *= penalties[3] if steering_of(motion) != 0.0 else 1.0
            g_free = g[state] + (penalties[2] if direction != direction_of(motions[state]) else 0.0)
            if key in best and best[key] <= g_free + weight:
                continue
            cost = driven_cost(cells, unknown, geometry, samples, pose, arc)
            if cost < 0.0:
                continue
            g_new = g_free + weight * (1.0 + penalties[0] * cost / 252.0)
            if key in best and best[key] <= g_new:
                continue
            estimate = _heuristic(reached, goal, field, geometry, radius, reversing)
            if np.isinf(estimate):
                continue
            best[key] = g_new
            if count == g.size:
                poses, g = np.concatenate((poses, np.empty_like(poses))), np.concatenate((g, np.empty_like(g)))
                parents = np.concatenate((parents, np.empty_like(parents)))
                motions = np.concatenate((motions, np.empty_like(motions)))
            poses[count], g[count], parents[count], motions[count] = reached, g_new, state, motion
            heapq.heappush(heap, (g_new + estimate, count))
            count += 1

    # 3. The arcs from the start, then the curve; without a curve the state that will do.
    if status != FOUND:
        curve = np.empty((0, 3))
        last = _nearest_state(poses, count, wanted, tolerance) if tolerance > 0.0 else -1
        if last < 0:
            return status, curve, 0.0, count
        status = NEARBY
    path = np.concatenate((path_to(poses, parents, motions, last, step, radius, pieces), curve))
    return status, path, g[last] + curve.shape[0] * geometry[0], count
