"""Straight lines over a padded grid: exact cost between two cell centres, and shortcuts along a path.

The cost of a line is the sum over the cells it crosses of length times traversal, the same measure that
``grid_search`` uses for its steps. Where a line passes exactly between two diagonal cells both must be free, which is
the rule against cutting corners.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, kernel, plain_kernel
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid


@plain_kernel
def line_cost(grid: PaddedGrid, a: int, b: int) -> np.float32:
    """Cost of the straight line between the centres of two cells (flat padded indices); inf if it is blocked.

    Cell by cell as in Amanatides and Woo 1987, the order of the crossings decided in integers.
    """
    cells, stride, table = grid
    ax, ay, bx, by = a % stride, a // stride, b % stride, b // stride
    dx, dy = abs(bx - ax), abs(by - ay)
    step_x = 1 if bx > ax else -1
    step_y = stride if by > ay else -stride
    if dx + dy == 0:
        return np.float32(0.0)
    length = np.sqrt(np.float64(dx * dx + dy * dy))
    per_x = 1.0 / dx if dx > 0 else 0.0
    per_y = 1.0 / dy if dy > 0 else 0.0
    cell, total, done = a, 0.0, 0.0
    crossed_x, crossed_y = 0, 0
    while cell != b:
        # The next border lies at (crossed + 0.5) / d of the line, on either axis; compare by cross-multiplication.
        order = (2 * crossed_x + 1) * dy - (2 * crossed_y + 1) * dx
        here = table[cells[cell]]
        if order <= 0 and crossed_x < dx:
            border = (crossed_x + 0.5) * per_x
        else:
            border = (crossed_y + 0.5) * per_y
        if order == 0 and np.isinf(table[cells[cell + step_x]] + table[cells[cell + step_y]]):
            return np.float32(np.inf)
        if order <= 0:
            cell += step_x
            crossed_x += 1
        if order >= 0:
            cell += step_y
            crossed_y += 1
        total += (border - done) * here
        done = border
        if np.isinf(table[cells[cell]]):
            return np.float32(np.inf)
    return np.float32((total + (1.0 - done) * table[cells[b]]) * length)


@plain_kernel
def lines_cost(grid: PaddedGrid, corners: NDArray[np.int32]) -> float:
    """Sum of the costs of the straight lines between flat padded indices (n,), from the first on."""
    total = 0.0
    for i in range(len(corners) - 1):
        total += float(line_cost(grid, Count(corners[i]), Count(corners[i + 1])))
    return total


@kernel
def pull_string(grid: PaddedGrid, path: NDArray[np.int32]) -> NDArray[np.int32]:
    """Drop every point of a path (n,) of flat padded indices whose neighbours see each other at no higher cost.

    Repeats until nothing changes; the ends stay, and the cost never grows.
    """
    current = path.copy()
    changed = True
    while changed and current.size > 2:
        changed = False
        kept = np.empty_like(current)
        kept[0] = current[0]
        count = 1
        for i in range(1, current.size - 1):
            before, here, after = Count(kept[count - 1]), Count(current[i]), Count(current[i + 1])
            direct = line_cost(grid, before, after)
            around = line_cost(grid, before, here) + line_cost(grid, here, after)
            if direct <= around:
                changed = True
            else:
                kept[count] = here
                count += 1
        kept[count] = current[-1]
        current = kept[: count + 1].copy()
    return current
