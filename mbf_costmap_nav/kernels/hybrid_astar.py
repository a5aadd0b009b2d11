"""Hybrid A*: a search over positions and headings whose steps are arcs a car can drive.

States are continuous; two of them are the same if they fall into one cell and one of ``HEADINGS`` heading bins. The
heuristic is the larger of the way around obstacles (a field on the grid from the goal) and the free curve of a car.
Now and then a curve is tried straight to the goal (analytic expansion), which also meets the goal's heading exactly.

Formula: Dolgov, Thrun, Montemerlo, Diebel 2010, without its Voronoi field: cells' costs do that here.
"""

from __future__ import annotations

import heapq

import numpy as np
from numba.typed import Dict
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.car_curves import car_curve, drive, sample_word
from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.footprint_cost import footprint_cost
from mbf_costmap_nav.kernels.grid_search import CANCELED, EXHAUSTED, FOUND

HEADINGS = 72
POLL_INTERVAL = 64
CURVE_RANGE = 10.0
"""Beyond this many turning radii the free curve adds nothing to the heuristic and is not computed."""


@kernel
def pose_cost(
    cells: NDArray[np.uint8], geometry: NDArray[np.float64], samples: NDArray[np.float64], pose: NDArray[np.float64]
) -> int:
    """Cost of the centre's cell at a pose (x, y, yaw), or -1 if the robot does not fit there.

    ``geometry`` is (resolution, origin_x, origin_y). The footprint is only looked at where the map has a cost at all.
    """
    ix = int(np.floor((pose[0] - geometry[1]) / geometry[0]))
    iy = int(np.floor((pose[1] - geometry[2]) / geometry[0]))
    if ix < 0 or iy < 0 or ix >= cells.shape[1] or iy >= cells.shape[0]:
        return -1
    cost = int(cells[iy, ix])
    if cost >= 253:
        return -1
    worst = footprint_cost(cells, geometry[0], geometry[1], geometry[2], samples, pose[0], pose[1], pose[2])
    return -1 if worst == 254 or worst < 0 else cost


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
def _is_free(
    cells: NDArray[np.uint8],
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> bool:
    """Whether the footprint touches nothing at any of the poses (n, 3)."""
    for i in range(poses.shape[0]):
        if pose_cost(cells, geometry, samples, poses[i]) < 0:
            return False
    return True


@kernel
def _states_from_start(poses: NDArray[np.float64], parents: NDArray[np.int64], last: int) -> NDArray[np.float64]:
    """Poses (n, 3) of the states that lead to ``last``, from the start on."""
    length, state = 0, last
    while state >= 0:
        length += 1
        state = parents[state]
    states = np.empty((length, 3))
    state = last
    for i in range(length - 1, -1, -1):
        states[i] = poses[state]
        state = parents[state]
    return states


@kernel
def hybrid_search(
    cells: NDArray[np.uint8],
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    field: NDArray[np.float32],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
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
    geometry : (resolution, origin_x, origin_y)
    samples : (n, 2) float64
        Covering points of the footprint [m].
    field : (height, width) float32
        Grid distance [cells] from the goal around obstacles, inf where there is no way.
    penalties : (cost factor, reverse factor, change of direction [m], turning factor)
    max_states : int
        Give up after so many states.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    poses : (m, 3) float64
        From the start to the goal.
    cost : float
        Weighted length [m].
    expanded : int
    """
    width = cells.shape[1]
    step = max(1.5 * geometry[0], 2.0 * np.pi / HEADINGS * radius)  # leaves the cell, turns by a bin at least
    capacity = 1024
    poses, g = np.empty((capacity, 3)), np.empty(capacity)
    parents, directions = np.empty(capacity, dtype=np.int64), np.empty(capacity)
    poses[0], g[0], parents[0], directions[0] = start, 0.0, -1, 1.0
    count, expanded, until_curve = 1, 0, 0
    best = Dict()
    best[_bin_of(start, geometry, width)] = 0.0
    heap = [(_heuristic(start, goal, field, geometry, radius, reversing), 0)]
    status, last = EXHAUSTED, 0
    curve = np.empty((0, 3))
    while len(heap) > 0 and count < max_states:
        _, state = heapq.heappop(heap)
        pose = poses[state].copy()
        if g[state] > best[_bin_of(pose, geometry, width)] + 1e-9:
            continue
        expanded += 1
        if expanded % POLL_INTERVAL == 1 and cancel_flag[0] != 0:
            status = CANCELED
            break

        # 1. Analytic expansion, more often the nearer the goal is.
        until_curve -= 1
        if until_curve <= 0:
            until_curve = int(_heuristic(pose, goal, field, geometry, radius, reversing) / (2.0 * step))
            curve = sample_word(
                pose[0], pose[1], pose[2], _curve_to(pose, goal, radius, reversing), radius, geometry[0]
            )
            if _is_free(cells, geometry, samples, curve):
                status, last = FOUND, state
                break

        # 2. Six arcs (three forward ones if the car may not reverse).
        for k in range(6 if reversing else 3):
            steering, direction = float(k % 3 - 1), 1.0 if k < 3 else -1.0
            x, y, yaw = drive(pose[0], pose[1], pose[2], steering, direction * step, radius)
            reached = np.array([x, y, yaw])
            cost = pose_cost(cells, geometry, samples, reached)
            if cost < 0:
                continue
            weight = step * (1.0 + penalties[0] * cost / 252.0)
            weight *= penalties[1] if direction < 0.0 else 1.0
            weight *= penalties[3] if steering != 0.0 else 1.0
            g_new = g[state] + weight + (penalties[2] if direction != directions[state] else 0.0)
            key = _bin_of(reached, geometry, width)
            if key in best and best[key] <= g_new:
                continue
            estimate = _heuristic(reached, goal, field, geometry, radius, reversing)
            if np.isinf(estimate):
                continue
            best[key] = g_new
            if count == g.size:
                poses, g = np.concatenate((poses, np.empty_like(poses))), np.concatenate((g, np.empty_like(g)))
                parents = np.concatenate((parents, np.empty_like(parents)))
                directions = np.concatenate((directions, np.empty_like(directions)))
            poses[count], g[count], parents[count], directions[count] = reached, g_new, state, direction
            heapq.heappush(heap, (g_new + estimate, count))
            count += 1
    if status != FOUND:
        return status, np.empty((0, 3)), 0.0, expanded

    # 3. The states back to the start, then the curve.
    result = np.concatenate((_states_from_start(poses, parents, last), curve))
    return status, result, g[last] + curve.shape[0] * geometry[0], expanded
