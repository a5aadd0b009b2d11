"""Relaxation of a path's points against each other, their origin, and the costs around them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.costs import UNKNOWN
from mbf_costmap_nav.kernels.map.line_cells import cost_along

UNKNOWN_AS = 0
"""Unknown cells do not push a path away."""
HIGHEST = 252
"""Cells of higher costs than this are no place for the robot's middle."""


@kernel
def costs_near(cells: NDArray[np.uint8], points: NDArray[np.float64], lines: int) -> NDArray[np.int64]:
    """Highest costs that a path meets, taken one cell nearer to obstacles than it lies.

    Parameters
    ----------
    points : (n, 2) float64
        In cell units, on the map.
    lines : int
        How many lines before each point, and behind it, count.

    Returns
    -------
    (n,) int64
        Highest cost, at most ``HIGHEST``, of the cells within one cell of these lines.
    """
    count = points.shape[0]
    of_lines = np.zeros(count - 1, dtype=np.int64)
    for i in range(count - 1):
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        steps = int(2.0 * max(abs(dx), abs(dy))) + 1
        for step in range(steps + 1):
            ix = math.floor(points[i, 0] + dx * step / steps)
            iy = math.floor(points[i, 1] + dy * step / steps)
            for y in range(max(iy - 1, 0), min(iy + 2, cells.shape[0])):
                for x in range(max(ix - 1, 0), min(ix + 2, cells.shape[1])):
                    cost = int(cells[y, x]) if cells[y, x] < UNKNOWN else UNKNOWN_AS
                    of_lines[i] = max(of_lines[i], min(cost, HIGHEST))
    costs = np.zeros(count, dtype=np.int64)
    for i in range(count):
        for line in range(max(i - lines, 0), min(i + lines, count - 1)):
            costs[i] = max(costs[i], of_lines[line])
    return costs


@kernel
def relax_path(
    cells: NDArray[np.uint8],
    points: NDArray[np.float64],
    data_weight: float,
    smooth_weight: float,
    limits: NDArray[np.int64],
    fixed: NDArray[np.bool_],
    tolerance: float,
    max_sweeps: int,
    cancel_flag: NDArray[np.uint8],
) -> tuple[NDArray[np.float64], int]:
    """Gauss-Seidel sweeps of the classic path smoother: pull each point to its origin and to its neighbours' middle.

    A point only moves where the lines to its neighbours have costs of at most its limit, or lower ones than now, so a
    path never enters lethal cells and gets no nearer to obstacles than that.

    Parameters
    ----------
    points : (n, 2) float64
        In cell units (cell (ix, iy) spans ix .. ix + 1); the first and the last stay.
    limits : (n,) int64
        Highest costs.
    fixed : (n,) bool
        Points that stay.
    tolerance : float
        Largest motion [cells] of a sweep at which to stop.

    Returns
    -------
    smoothed : (n, 2) float64
    sweeps : int
        Number of sweeps done.
    """
    smoothed = points.copy()
    for sweep in range(max_sweeps):
        if cancel_flag[0] != 0:
            return smoothed, sweep
        largest = 0.0
        for i in range(1, smoothed.shape[0] - 1):
            if fixed[i]:
                continue
            x, y = smoothed[i, 0], smoothed[i, 1]
            x_new = (
                x
                + data_weight * (points[i, 0] - x)
                + smooth_weight * (smoothed[i - 1, 0] + smoothed[i + 1, 0] - 2.0 * x)
            )
            y_new = (
                y
                + data_weight * (points[i, 1] - y)
                + smooth_weight * (smoothed[i - 1, 1] + smoothed[i + 1, 1] - 2.0 * y)
            )
            before, after = smoothed[i - 1], smoothed[i + 1]
            cost = max(
                cost_along(cells, UNKNOWN_AS, before[0], before[1], x_new, y_new),
                cost_along(cells, UNKNOWN_AS, x_new, y_new, after[0], after[1]),
            )
            if cost > limits[i] and cost >= max(
                cost_along(cells, UNKNOWN_AS, before[0], before[1], x, y),
                cost_along(cells, UNKNOWN_AS, x, y, after[0], after[1]),
            ):
                continue
            smoothed[i, 0], smoothed[i, 1] = x_new, y_new
            largest = max(largest, max(abs(x_new - x), abs(y_new - y)))
        if largest < tolerance:
            return smoothed, sweep + 1
    return smoothed, max_sweeps
