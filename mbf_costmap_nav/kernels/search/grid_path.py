"""Paths out of a potential on a padded grid: cell by cell, or down its interpolated gradient.

Both walk from a reached cell down to the source of the field that ``grid_search.search`` filled. The cell path is the
exact shortest 8-connected one; the gradient path (navfn's idea) leaves the eight directions and looks smoother, but
may be a little longer or shorter than in the field, and needs a field around the path, not only on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, brief_kernel, inner_kernel, kernel
from mbf_costmap_nav.kernels.search.padded_grid import SQRT2, PaddedGrid

GRADIENT_STEP = 0.5
"""Length of a step down the gradient [cells]."""
STEPS_PER_CELL = 4
"""A descent that stays in one cell longer than this turns in a ridge and is moved on to the best neighbour."""


@inner_kernel
def best_predecessor(grid: PaddedGrid, g: NDArray[np.float32], cell: int, cut_corners: bool) -> int:
    """Neighbour over which the search reached ``cell``: the one with the least ``g + step`` (not stored, refound)."""
    cells, stride, table = grid
    best, best_g = cell, np.float32(np.inf)
    here = np.float32(0.5) * table[cells[cell]]
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            neighbour = cell + dy * stride + dx
            if not g[neighbour] < g[cell]:
                continue
            step = here + np.float32(0.5) * table[cells[neighbour]]
            if dx != 0 and dy != 0:
                step *= SQRT2
                if not cut_corners and np.isinf(table[cells[cell + dx]] + table[cells[cell + dy * stride]]):
                    continue
            if g[neighbour] + step < best_g:
                best, best_g = neighbour, g[neighbour] + step
    return best


@brief_kernel
def trace_cells(grid: PaddedGrid, g: NDArray[np.float32], end: int, cut_corners: bool) -> NDArray[np.int32]:
    """Follow the best predecessors from ``end``, a reached cell, to the source of ``g``.

    Returns
    -------
    path : (m,) int32
        Flat padded indices from ``end`` to the source (g = 0), both included.
    """
    path = np.empty(1024, dtype=np.int32)
    path[0] = end
    length = 1
    cell = end
    while g[cell] > 0.0:
        cell = best_predecessor(grid, g, cell, cut_corners)
        if length == path.size:
            path = np.concatenate((path, np.empty_like(path)))
        path[length] = cell
        length += 1
    return path[:length].copy()


@inner_kernel
def _slope(g: NDArray[np.float32], cell: int, step: int) -> float:
    """Slope of ``g`` at a cell along ``step``: central, one-sided next to unreached cells, 0 between two of them."""
    ahead, behind = g[cell + step], g[cell - step]
    if np.isinf(ahead):
        return 0.0 if np.isinf(behind) else float(g[cell] - behind)
    return float(ahead - g[cell]) if np.isinf(behind) else 0.5 * float(ahead - behind)


@inner_kernel
def _interpolated_gradient(g: NDArray[np.float32], stride: int, x: float, y: float) -> tuple[float, float]:
    """Bilinear gradient of ``g`` at a point [padded cells] from the four cells around it, unreached ones left out."""
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    slope_x, slope_y = 0.0, 0.0
    for j in range(2):
        for i in range(2):
            corner = (y0 + j) * stride + x0 + i
            weight = (1.0 - abs(x - x0 - i)) * (1.0 - abs(y - y0 - j))
            if weight > 0.0 and g[corner] < np.inf:
                slope_x += weight * _slope(g, corner, Count(1))
                slope_y += weight * _slope(g, corner, stride)
    return slope_x, slope_y


@kernel
def trace_gradient(grid: PaddedGrid, g: NDArray[np.float32], end: int) -> NDArray[np.float64]:
    """Descend the interpolated gradient of ``g`` from the centre of ``end`` to the source of the field.

    Where the descent would enter an unreached cell, go up or turn on the spot it moves to the best predecessor, so it
    always arrives.

    Returns
    -------
    points : (m, 2) float64
        Points (x, y) in padded cell units (a cell's centre has whole numbers), from ``end`` to the source.
    """
    points, stride = np.empty((1024, 2)), grid.stride
    x, y = float(end % stride), float(end // stride)
    points[0, 0], points[0, 1] = x, y
    count, steps_inside = 1, 0
    cell = end
    while g[cell] > 0.0:
        slope_x, slope_y = _interpolated_gradient(g, stride, x, y)
        norm = np.hypot(slope_x, slope_y)
        step_down = norm > 1e-9 and steps_inside < STEPS_PER_CELL
        if step_down:
            x_new, y_new = x - GRADIENT_STEP * slope_x / norm, y - GRADIENT_STEP * slope_y / norm
            column, row = int(np.floor(x_new + 0.5)), int(np.floor(y_new + 0.5))
            after = row * stride + column
            beside = max(g[(cell // stride) * stride + column], g[row * stride + cell % stride])
            step_down = beside < np.inf and (after == cell or g[after] < g[cell])
        if step_down:
            x, y = x_new, y_new
        else:
            after = best_predecessor(grid, g, cell, False)
            x, y = float(after % stride), float(after // stride)
        steps_inside = steps_inside + 1 if after == cell else 0
        cell = after
        if g[cell] == 0.0:
            x, y = float(cell % stride), float(cell // stride)
        if count == points.shape[0]:
            points = np.concatenate((points, np.empty_like(points)))
        points[count, 0], points[count, 1] = x, y
        count += 1
    return points[:count].copy()
