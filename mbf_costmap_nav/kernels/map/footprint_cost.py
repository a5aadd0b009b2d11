"""Cost of a footprint at many poses, for rollouts: the largest cell value under footprint samples.

When to use: thousands of poses a cycle (controllers, recoveries, hybrid A*). When not: one exact answer with every
cell counted once, which is the job of the pose queries. The samples are at most half a cell apart on the
outline and a cell apart inside, so only a corner of a cell that the outline clips by less than a quarter of its side
can be missed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import brief_kernel, inner_kernel, kernel, plain_kernel
from mbf_costmap_nav.kernels.costs import LETHAL

SPARE_REACH = 0.5
"""How much larger the square is that is looked at once for many poses, in reaches of the footprint."""
ROUNDING = 1e-6
"""How much [cells] farther a sample counts than it is."""
OUTSIDE = -1
"""Cost of a pose whose footprint leaves the map and touches nothing worse."""


@plain_kernel
def footprint_cost(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    samples: NDArray[np.float64],
    x: float,
    y: float,
    yaw: float,
) -> int:
    """Largest cost under the footprint, unknown not counted.

    Parameters
    ----------
    cells : (height, width) uint8
    resolution, origin_x, origin_y : float
        Grid geometry [m].
    samples : (n, 2) float64
        Footprint samples in the base frame [m].
    x, y, yaw : float
        Pose of the base [m, rad].

    Returns
    -------
    int
        FREE..LETHAL, or OUTSIDE if a point is off the map and no cell is lethal.
    """
    height, width = cells.shape
    c, s = np.cos(yaw) / resolution, np.sin(yaw) / resolution
    x_cells, y_cells = (x - origin_x) / resolution, (y - origin_y) / resolution
    worst, outside = 0, False
    for i in range(samples.shape[0]):
        ix = int(np.floor(x_cells + c * samples[i, 0] - s * samples[i, 1]))
        iy = int(np.floor(y_cells + s * samples[i, 0] + c * samples[i, 1]))
        if ix < 0 or iy < 0 or ix >= width or iy >= height:
            outside = True
            continue
        cost = int(cells[iy, ix])
        if cost == LETHAL:
            return LETHAL
        if worst < cost < LETHAL:
            worst = cost
    return OUTSIDE if outside else worst


@brief_kernel
def first_lethal(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    samples: NDArray[np.float64],
    x: float,
    y: float,
    cosine: float,
    sine: float,
) -> tuple[int, int]:
    """The lethal cell (ix, iy) under the first sample of the footprint that lies on one; (-1, -1) if none does."""
    height, width = cells.shape
    for i in range(samples.shape[0]):
        ix = int(np.floor((cosine * samples[i, 0] - sine * samples[i, 1] + x - origin_x) / resolution))
        iy = int(np.floor((sine * samples[i, 0] + cosine * samples[i, 1] + y - origin_y) / resolution))
        if 0 <= ix < width and 0 <= iy < height and cells[iy, ix] == LETHAL:
            return ix, iy
    return -1, -1


@plain_kernel
def first_collision(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    samples: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> int:
    """Index of the first of the poses (n, 3: x, y, yaw) whose footprint touches a lethal cell; -1 without one.

    Most poses are away from obstacles, and the next ones near them: where no cell of a larger square is lethal, their
    samples are not looked at.
    """
    reach = _reach(samples) / resolution
    spare = SPARE_REACH * reach + 1.0
    clear_x, clear_y = np.nan, np.nan  # the middle of the square that is known to be clear
    for i in range(poses.shape[0]):
        x, y = (poses[i, 0] - origin_x) / resolution, (poses[i, 1] - origin_y) / resolution
        if abs(x - clear_x) <= spare and abs(y - clear_y) <= spare:
            continue
        if _square_is_clear(cells, x, y, reach + spare):
            clear_x, clear_y = x, y
            continue
        cost = footprint_cost(cells, resolution, origin_x, origin_y, samples, poses[i, 0], poses[i, 1], poses[i, 2])
        if cost == LETHAL:
            return i
    return -1


@plain_kernel
def _reach(samples: NDArray[np.float64]) -> float:
    """Distance [m] from the base to the farthest sample."""
    farthest = 0.0
    for i in range(samples.shape[0]):
        farthest = max(farthest, samples[i, 0] * samples[i, 0] + samples[i, 1] * samples[i, 1])
    return float(np.sqrt(farthest))


@inner_kernel
def _square_is_clear(cells: NDArray[np.uint8], x: float, y: float, reach: float) -> bool:
    """Whether no cell of the map at most ``reach`` along x and y from a point [cells] is lethal."""
    height, width = cells.shape
    wide, ix, iy = int(np.ceil(reach + ROUNDING)), int(np.floor(x)), int(np.floor(y))
    first, last = max(ix - wide, 0), min(ix + wide + 1, width)
    for row in range(max(iy - wide, 0), min(iy + wide + 1, height)):
        lethal = np.uint8(0)
        for column in range(first, last):  # without a branch, so that it becomes vector code
            lethal |= np.uint8(cells[row, column] == LETHAL)
        if lethal != 0:
            return False
    return True


@kernel
def collisions(
    cells: NDArray[np.uint8],
    resolution: float,
    origin_x: float,
    origin_y: float,
    samples: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Which of the poses (n, 3: x, y, yaw) have a lethal cell under their footprint, (n,)."""
    touching = np.zeros(poses.shape[0], dtype=np.bool_)
    for i in range(poses.shape[0]):
        cost = footprint_cost(cells, resolution, origin_x, origin_y, samples, poses[i, 0], poses[i, 1], poses[i, 2])
        touching[i] = cost == LETHAL
    return touching
