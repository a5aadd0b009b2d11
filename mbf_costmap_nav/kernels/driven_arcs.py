"""Arcs that a car drives over a costmap: whether it fits all along them, what they cost, and the poses on them.

When to use: by ``hybrid_astar``, whose steps are longer than a cell where the turning circle is large. When not:
trajectories of velocities in time, which ``rollout`` integrates.

An arc is sampled every ``spacing`` [m]. The footprint is looked at at each sample, and the centre in every cell between
two of them, so the path made of the same samples is free wherever it is drawn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.car_curves import drive
from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.footprint_cost import footprint_cost
from mbf_costmap_nav.kernels.line_cells import cost_along

FORWARD_MOTIONS, MOTIONS = 3, 6
"""Motions 0-2 go right, straight and left; 3-5 do so backward."""


@kernel
def steering_of(motion: int) -> float:
    """-1 right, 0 straight, 1 left."""
    return float(motion % 3 - 1)


@kernel
def direction_of(motion: int) -> float:
    """1 forward, -1 backward."""
    return 1.0 if motion < FORWARD_MOTIONS else -1.0


@kernel
def pose_cost(
    cells: NDArray[np.uint8],
    unknown: int,
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    pose: NDArray[np.float64],
) -> int:
    """Cost of the centre's cell at a pose (x, y, yaw), or -1 if the robot does not fit there.

    ``geometry`` is (resolution, origin_x, origin_y); a centre in an unknown cell counts as ``unknown``.
    """
    ix = int(np.floor((pose[0] - geometry[1]) / geometry[0]))
    iy = int(np.floor((pose[1] - geometry[2]) / geometry[0]))
    if ix < 0 or iy < 0 or ix >= cells.shape[1] or iy >= cells.shape[0]:
        return -1
    cost = int(cells[iy, ix]) if cells[iy, ix] < 255 else unknown
    if cost >= 253:
        return -1
    worst = footprint_cost(cells, geometry[0], geometry[1], geometry[2], samples, pose[0], pose[1], pose[2])
    return -1 if worst == 254 or worst < 0 else cost


@kernel
def driven_cost(
    cells: NDArray[np.uint8],
    unknown: int,
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    start: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> float:
    """Mean cost of the centre over poses (n, 3) that are driven one after the other from ``start``, or -1.

    -1: the robot does not fit at one of them, or its centre crosses a blocked cell on the way to it. 0 without poses.
    """
    total = 0.0
    x, y = (start[0] - geometry[1]) / geometry[0], (start[1] - geometry[2]) / geometry[0]
    for i in range(poses.shape[0]):
        x_next, y_next = (poses[i, 0] - geometry[1]) / geometry[0], (poses[i, 1] - geometry[2]) / geometry[0]
        if cost_along(cells, unknown, x, y, x_next, y_next) >= 253:
            return -1.0
        cost = pose_cost(cells, unknown, geometry, samples, poses[i])
        if cost < 0:
            return -1.0
        total += cost
        x, y = x_next, y_next
    return float(total / max(1, poses.shape[0]))


@kernel
def first_fit(
    cells: NDArray[np.uint8],
    unknown: int,
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> int:
    """Index of the first of the poses (n, 3) at which the robot fits, or -1."""
    for i in range(poses.shape[0]):
        if pose_cost(cells, unknown, geometry, samples, poses[i]) >= 0:
            return i
    return -1


@kernel
def sample_arc(pose: NDArray[np.float64], motion: int, length: float, radius: float, into: NDArray[np.float64]) -> None:
    """Fill ``into`` (n, 3) with poses evenly spaced over an arc of ``length`` [m], the start left out."""
    signed, steering = direction_of(motion) * length, steering_of(motion)
    for i in range(into.shape[0]):
        share = (i + 1) / into.shape[0]
        into[i, 0], into[i, 1], into[i, 2] = drive(pose[0], pose[1], pose[2], steering, signed * share, radius)


@kernel
def path_to(
    poses: NDArray[np.float64],
    parents: NDArray[np.int64],
    motions: NDArray[np.int8],
    last: int,
    length: float,
    radius: float,
    pieces: int,
) -> NDArray[np.float64]:
    """Poses (n, 3) from the start to state ``last``: ``pieces`` on each arc of ``length`` [m] that led there."""
    arcs, state = 0, last
    while parents[state] >= 0:
        arcs += 1
        state = parents[state]
    path = np.empty((1 + arcs * pieces, 3))
    path[0] = poses[state]
    state = last
    for arc in range(arcs - 1, -1, -1):
        begin = 1 + arc * pieces
        sample_arc(poses[parents[state]], motions[state], length, radius, path[begin : begin + pieces])
        state = parents[state]
    return path
