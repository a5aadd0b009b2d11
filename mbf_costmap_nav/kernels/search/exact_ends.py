"""From the cells of a path to points in metres that begin and end exactly where they are asked to."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, brief_kernel, kernel
from mbf_costmap_nav.kernels.map.line_cells import cost_along

FloatArray = NDArray[np.float64]


@brief_kernel
def with_exact_ends(
    cells: NDArray[np.uint8],
    unknown: int,
    first_blocked: int,
    geometry: FloatArray,
    points: FloatArray,
    start_x: float,
    start_y: float,
    goal_x: float,
    goal_y: float,
    distance: float,
) -> FloatArray:
    """Replace the ends of a path of cell centres by the exact start and the exact goal.

    Parameters
    ----------
    cells : (height, width) uint8
    unknown : int
        What an unknown cell counts as, 0 .. 254.
    first_blocked : int
        Least cost that no line may lead through.
    geometry : (resolution, origin_x, origin_y) float64
        [m].
    points : (n, 2) float64
        [m]; at least one.
    start_x, start_y, goal_x, goal_y : float
        [m]; a goal of nan leaves the end as it is.
    distance : float
        Points this near [m] to the exact start or goal are dropped: going there first would be a step back.

    Returns
    -------
    points : (m, 2) float64
        Where the line from an exact end to the rest is blocked, all points are kept: a line within one cell is free.
    """
    points = _exactly_from(cells, unknown, first_blocked, geometry, points, start_x, start_y, distance)
    if math.isnan(goal_x):
        return points
    turned = _reversed(points)
    return _reversed(_exactly_from(cells, unknown, first_blocked, geometry, turned, goal_x, goal_y, distance))


@kernel
def _exactly_from(
    cells: NDArray[np.uint8],
    unknown: int,
    first_blocked: int,
    geometry: FloatArray,
    points: FloatArray,
    x: float,
    y: float,
    distance: float,
) -> FloatArray:
    """Begin with a point of the first point's cell instead of that point, and of what lies as near."""
    kept, count = Count(0), len(points)
    if count > 1:
        kept = Count(1)
        while kept < count - 1 and math.hypot(points[kept, 0] - x, points[kept, 1] - y) <= distance:
            kept += 1
        x0, y0 = (x - geometry[1]) / geometry[0], (y - geometry[2]) / geometry[0]
        x1, y1 = (points[kept, 0] - geometry[1]) / geometry[0], (points[kept, 1] - geometry[2]) / geometry[0]
        if cost_along(cells, unknown, x0, y0, x1, y1) >= first_blocked:
            kept = Count(0)
    begun = np.empty((count - kept + 1, 2))
    begun[0, 0], begun[0, 1] = x, y
    for i in range(kept, count):
        begun[i - kept + 1, 0], begun[i - kept + 1, 1] = points[i, 0], points[i, 1]
    return begun


@kernel
def _reversed(points: FloatArray) -> FloatArray:
    """The points (n, 2) from the last to the first."""
    turned, last = np.empty_like(points), len(points) - 1
    for i in range(len(points)):
        turned[i, 0], turned[i, 1] = points[last - i, 0], points[last - i, 1]
    return turned


@brief_kernel
def cell_centres(indices: NDArray[np.int32], stride: int, geometry: FloatArray) -> FloatArray:
    """Centres (n, 2) [m] of the cells of flat padded indices (n,)."""
    centres = np.empty((len(indices), 2))
    for i in range(len(indices)):
        index = Count(indices[i])
        centres[i, 0] = (float(index % stride - 1) + 0.5) * geometry[0] + geometry[1]
        centres[i, 1] = (float(index // stride - 1) + 0.5) * geometry[0] + geometry[2]
    return centres
