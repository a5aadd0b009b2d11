"""The reached cell nearest to a goal: where a path may end when the goal itself cannot be reached.

When to use: with a field of costs from the start. When not: any free place, reached or not (``free_pose``).

Rows are visited outward from the goal's, and only as far as nothing nearer has been found, so a large tolerance costs
no more than the distance to what is found.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.car.ground import pose_cost

SAME_DISTANCE = 1e-6
"""Of cells whose distances [m] differ by less the one of lower cost is taken."""


@kernel
def nearest_reached(
    g: NDArray[np.float32],
    cells: NDArray[np.uint8],
    unknown: int,
    geometry: NDArray[np.float64],
    samples: NDArray[np.float64],
    goal: NDArray[np.float64],
    tolerance: float,
    cancel_flag: NDArray[np.uint8],
) -> tuple[int, int]:
    """Cell (ix, iy) of finite ``g`` whose centre is nearest to the goal, or (-1, -1) without one.

    Parameters
    ----------
    g : (n,) float32
        Costs from the start on the grid padded by one cell on every side.
    cells : (height, width) uint8
    unknown, geometry, samples
        As for ``ground.pose_cost``; without samples no robot has to fit anywhere.
    goal : (3,) float64
        x, y [m], and the heading [rad] at which the robot has to fit.
    tolerance : float
        How far [m] it may be; inf = anywhere.
    """
    height, width = cells.shape
    best, best_g, best_x, best_y = tolerance, np.inf, -1, -1
    pose = goal.copy()
    first_x = min(max(int(np.floor((goal[0] - geometry[1]) / geometry[0])), 0), width - 1)
    first_y = min(max(int(np.floor((goal[1] - geometry[2]) / geometry[0])), 0), height - 1)
    for row in range(2 * height):
        iy = first_y + ((row + 1) // 2 if row % 2 else -(row // 2))
        if ((row + 1) // 2 - 1) * geometry[0] > best or cancel_flag[0] != 0:
            break
        pose[1] = geometry[2] + (iy + 0.5) * geometry[0]
        if iy < 0 or iy >= height or abs(pose[1] - goal[1]) > best:
            continue
        for column in range(2 * width):
            ix = first_x + ((column + 1) // 2 if column % 2 else -(column // 2))
            if ((column + 1) // 2 - 1) * geometry[0] > best:
                break
            if ix < 0 or ix >= width:
                continue
            cost = g[(iy + 1) * (width + 2) + ix + 1]
            pose[0] = geometry[1] + (ix + 0.5) * geometry[0]
            distance = np.hypot(pose[0] - goal[0], pose[1] - goal[1])
            if np.isinf(cost) or distance > min(best + SAME_DISTANCE, tolerance):
                continue
            if best_x >= 0 and distance > best - SAME_DISTANCE and cost >= best_g:
                continue
            if samples.shape[0] > 0 and pose_cost(cells, unknown, geometry, samples, pose) < 0:
                continue
            best, best_g, best_x, best_y = distance, cost, ix, iy
    return best_x, best_y
