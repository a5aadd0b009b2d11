"""Relaxation of a path's points against each other, their origin, and the costs around them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel


@kernel
def _cost_at(cells: NDArray[np.uint8], x: float, y: float) -> int:
    """Cost of the cell at a point [cells]; outside counts as lethal, unknown as free."""
    ix, iy = int(np.floor(x)), int(np.floor(y))
    if ix < 0 or iy < 0 or ix >= cells.shape[1] or iy >= cells.shape[0]:
        return 254
    return int(cells[iy, ix]) if cells[iy, ix] < 255 else 0


@kernel
def cost_along(cells: NDArray[np.uint8], x0: float, y0: float, x1: float, y1: float) -> int:
    """Highest cost of the cells a line [cells] runs through, cell by cell as Amanatides and Woo (1987)."""
    highest = _cost_at(cells, x0, y0)
    ix, iy, last_x, last_y = math.floor(x0), math.floor(y0), math.floor(x1), math.floor(y1)
    dx, dy = x1 - x0, y1 - y0
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    # The share of the line at which it crosses the next border on each axis.
    next_x = ((ix + (dx > 0.0)) - x0) / dx if dx != 0.0 else math.inf
    next_y = ((iy + (dy > 0.0)) - y0) / dy if dy != 0.0 else math.inf
    for _ in range(abs(last_x - ix) + abs(last_y - iy)):
        if next_x < next_y:
            ix += step_x
            next_x += abs(1.0 / dx)
        else:
            iy += step_y
            next_y += abs(1.0 / dy)
        highest = max(highest, _cost_at(cells, float(ix), float(iy)))
    return highest


@kernel
def relax_path(
    cells: NDArray[np.uint8],
    points: NDArray[np.float64],
    data_weight: float,
    smooth_weight: float,
    highest_cost: int,
    tolerance: float,
    max_sweeps: int,
    cancel_flag: NDArray[np.uint8],
) -> tuple[NDArray[np.float64], int]:
    """Gauss-Seidel sweeps of the classic path smoother: pull each point to its origin and to its neighbours' middle.

    A point only moves where the lines to its neighbours have costs of at most ``highest_cost``, or lower ones than now,
    so a path never enters lethal cells and gets no nearer to obstacles than that.

    Parameters
    ----------
    points : (n, 2) float64
        In cell units (cell (ix, iy) spans ix .. ix + 1); the first and the last stay.
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
                cost_along(cells, before[0], before[1], x_new, y_new),
                cost_along(cells, x_new, y_new, after[0], after[1]),
            )
            if cost > highest_cost and cost >= max(
                cost_along(cells, before[0], before[1], x, y), cost_along(cells, x, y, after[0], after[1])
            ):
                continue
            smoothed[i, 0], smoothed[i, 1] = x_new, y_new
            largest = max(largest, max(abs(x_new - x), abs(y_new - y)))
        if largest < tolerance:
            return smoothed, sweep + 1
    return smoothed, max_sweeps
