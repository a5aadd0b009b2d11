"""One bucket of lazy Theta*: check the credited lines of its cells, settle them, credit their neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, plain_kernel
from mbf_costmap_nav.kernels.search.open_list import IDLE
from mbf_costmap_nav.kernels.search.padded_grid import INF, SQRT2, Integer, PaddedGrid, octile_distance
from mbf_costmap_nav.kernels.search.short_lines import (
    BASE,
    GROWTH,
    HERE,
    LONGEST_LINE,
    SIDE,
    STEP_X,
    STEP_Y,
    WEIGHTS,
)

MORE_EXPENSIVE = np.float32(1.000001)
"""A line this much more expensive than credited gives way to the best neighbour."""


WORTH_OPENING = np.float32(0.999999)
"""A settled cell is opened again if its cost falls to this share of what it was."""


OPENED = np.uint8(254)
"""State of a settled cell that has been opened again and is not sorted into a bucket yet."""


class Labels(NamedTuple):
    """What the search knows of the cells (n,): their cost, where they come from, and where they wait.

    Attributes
    ----------
    g : (n,) float32
        Cost credited to a cell; negative (or 0) once it is settled, so that one look-up answers both.
    origin : (n,) uint8
        Code of the line by which a cell is reached, see ``short_lines``.
    queued : (n,) uint8
        Bucket in which a cell waits, IDLE or OPENED.
    """

    g: NDArray[np.float32]
    origin: NDArray[np.uint8]
    queued: NDArray[np.uint8]


@plain_kernel
def _relax(
    g: NDArray[np.float32],
    origin: NDArray[np.uint8],
    queued: NDArray[np.uint8],
    fresh: NDArray[np.int32],
    count: np.uint64,
    neighbour: np.uint64,
    credited: np.float32,
    code: Integer,
    stepped: np.float32,
    step_code: Integer,
) -> np.uint64:
    """Credit an open neighbour with a line, or open a settled one again; returns the count of noted cells.

    One opened again counts as settled all the while, so costs of settled cells only fall and parents form no circle.
    """
    known = g[neighbour]
    if stepped < -known * WORTH_OPENING:  # settled, as open ones are positive; rare, so it may be a branch
        g[neighbour], origin[neighbour], queued[neighbour] = -stepped, np.uint8(step_code), OPENED
        fresh[count] = neighbour
        return np.uint64(count + np.uint64(1))
    improved = credited < known
    g[neighbour] = credited if improved else known  # keeps what is known when blocked times no growth makes nan
    # origin = code if improved else origin, spelt in bits: compilers make a branch of the plain form.
    kept = origin[neighbour]
    origin[neighbour] = kept ^ ((kept ^ np.uint8(code)) & (np.uint8(0) - np.uint8(improved)))
    fresh[count] = neighbour
    return np.uint64(count + np.uint64(improved))


@inner_kernel
def _best_settled(grid: PaddedGrid, g: NDArray[np.float32], cell: Integer) -> tuple[np.float32, Integer]:
    """Cost over the settled neighbour with the cheapest step to ``cell``, and its code; inf without one."""
    cells, row, table = grid
    best, best_code = INF, np.int64(HERE)
    here = table[cells[cell]]
    for k in range(8):
        neighbour = cell - STEP_X[k] - row * STEP_Y[k]
        if g[neighbour] > 0.0:
            continue
        step = np.float32(0.5) * (here + table[cells[neighbour]])
        if k >= 4:
            step *= SQRT2
            if np.isinf(table[cells[cell - STEP_X[k]]] + table[cells[cell - row * STEP_Y[k]]]):
                continue
        if step - g[neighbour] < best:
            best, best_code = np.float32(step - g[neighbour]), np.int64(HERE) + STEP_X[k] + SIDE * STEP_Y[k]
    return best, best_code


@inner_kernel
def expand_bucket(
    grid: PaddedGrid,
    labels: Labels,
    crossed: NDArray[np.uint64],
    goal: int,
    upper_end: np.float32,
    waiting: NDArray[np.int32],
    slot: int,
    fresh: NDArray[np.int32],
) -> np.uint64:
    """Settle the cells of one bucket and credit their neighbours; fills ``fresh`` and returns its count.

    Cells whose key turns out to be above ``upper_end`` go back to the open list instead.
    """
    (cells, stride, table), (g, origin, queued) = grid, labels
    one, row, own = np.uint64(1), np.uint64(stride), np.uint8(slot)
    goal_x, goal_y = goal % stride, goal // stride
    half, diagonal_half = np.float32(0.5), np.float32(0.5) * SQRT2
    count = np.uint64(0)
    for i in range(np.uint64(waiting.size)):
        cell = np.uint64(waiting[i])
        if queued[cell] != own:
            continue
        queued[cell] = IDLE

        # 1. Check the credited line; take the best settled neighbour where that is better. Other cells wait again.
        known, code = g[cell], origin[cell]
        g_cell = -g[cell + crossed[code, 0]]  # the first cell of the line is the parent
        for j in range(np.uint64(LONGEST_LINE)):
            g_cell += WEIGHTS[code, j] * table[cells[cell + crossed[code, j]]]
        if known <= 0.0:  # settled before and opened again
            g_cell = -known
        elif g_cell > known * MORE_EXPENSIVE:
            best, best_code = _best_settled(grid, g, np.int64(cell))
            if best < g_cell:
                g_cell, code = best, np.uint8(best_code)
                origin[cell] = code
            dx, dy = np.int64(cell) % stride - goal_x, np.int64(cell) // stride - goal_y
            if g_cell + octile_distance(abs(dx), abs(dy)) >= upper_end:
                g[cell] = g_cell
                fresh[count] = cell
                count += one
                continue
        g[cell] = -g_cell

        # 2. Credit the neighbours with a line from the cell's own parent, or from the cell if that line is long.
        base, gain = np.int64(BASE[code]), GROWTH[code]
        here = table[cells[cell]]
        east, west = here + table[cells[cell + one]], here + table[cells[cell - one]]
        north, south = here + table[cells[cell + row]], here + table[cells[cell - row]]
        for neighbour, both, k, turn in (
            (cell + one, east, 0, 1),
            (cell - one, west, 1, -1),
            (cell + row, north, 2, SIDE),
            (cell - row, south, 3, -SIDE),
        ):
            stepped = g_cell + half * both
            credited = g_cell + gain[k] * both
            count = _relax(g, origin, queued, fresh, count, neighbour, credited, base + turn, stepped, HERE + turn)
        for neighbour, sides, k, turn in (
            (cell + row + one, north + east, 4, SIDE + 1),
            (cell + row - one, north + west, 5, SIDE - 1),
            (cell - row + one, south + east, 6, 1 - SIDE),
            (cell - row - one, south + west, 7, -1 - SIDE),
        ):
            both = here + table[cells[neighbour]] if sides < INF else INF
            stepped = g_cell + diagonal_half * both
            credited = g_cell + gain[k] * both
            count = _relax(g, origin, queued, fresh, count, neighbour, credited, base + turn, stepped, HERE + turn)
    return count
