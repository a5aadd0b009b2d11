"""Lazy Theta*: any-angle paths on a padded grid, one line of sight per settled cell.

When to use: short paths of few straight pieces. When not: an exact optimum (any-angle A* is a heuristic, usually
within 1 %), or where the eight directions do (``grid_search`` is twice as fast).

A neighbour is first credited with a straight line from its parent's parent, unchecked; the line is looked at when the
neighbour is about to be settled, and if it is blocked or dear the best settled neighbour becomes the parent instead
(Nash, Koenig, Tovey 2010, Lazy Theta*). Deviation: on weighted cells the line's cost is integrated exactly, and a cell
that turns out dearer than credited is put back into the open list. The open list is that of ``grid_search``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.grid_line import line_cost
from mbf_costmap_nav.kernels.grid_search import (
    BUCKET_WIDTH,
    CANCELED,
    EXHAUSTED,
    FOUND,
    POLL_INTERVAL,
    SQRT2,
    STEP_X,
    STEP_Y,
    ring_size,
)

LINE_LIMIT = np.float32(3.0)
"""A credited line grows no more once it is this long [cells], so that looking along it stays cheap; pulling the string
joins the pieces. Paths with 8 are as long to 0.04 %, but take 1.2 times the time."""


@kernel
def _length(dx: int, dy: int) -> np.float32:
    """Euclidean length of a difference of cells."""
    return np.float32(np.sqrt(np.float32(dx * dx + dy * dy)))


@kernel
def _best_settled(
    cells: NDArray[np.uint8],
    stride: int,
    table: NDArray[np.float32],
    g: NDArray[np.float32],
    settled: NDArray[np.uint8],
    cell: int,
) -> tuple[int, np.float32]:
    """Settled neighbour with the cheapest step to ``cell``, and the g over it; (cell, inf) without one."""
    best, best_g = cell, np.float32(np.inf)
    here = table[cells[cell]]
    for k in range(8):
        neighbour = cell + STEP_X[k] + stride * STEP_Y[k]
        if settled[neighbour] == 0:
            continue
        step = np.float32(0.5) * (here + table[cells[neighbour]])
        if k >= 4:
            step *= SQRT2
            if np.isinf(table[cells[cell + STEP_X[k]]] + table[cells[cell + stride * STEP_Y[k]]]):
                continue
        if g[neighbour] + step < best_g:
            best, best_g = neighbour, g[neighbour] + step
    return best, best_g


@kernel
def theta_search(
    cells: NDArray[np.uint8],
    stride: int,
    table: NDArray[np.float32],
    start: int,
    goal: int,
    cancel_flag: NDArray[np.uint8],
) -> tuple[int, NDArray[np.float32], NDArray[np.int32]]:
    """Settle cells from ``start`` until ``goal`` is settled.

    Parameters
    ----------
    cells, stride, table, start, goal, cancel_flag
        As for ``grid_search.search``; the traversal of a free cell is 1 or more.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    g : (n,) float32
        Cost of the settled cells; inf for all others.
    parent : (n,) int32
        Cell from which a straight line leads to the cell; the start's own is the start.
    """
    g = np.full(cells.size, np.float32(np.inf), dtype=np.float32)
    parent = np.empty(cells.size, dtype=np.int32)
    settled = np.zeros(cells.size, dtype=np.uint8)
    steps = STEP_X + stride * STEP_Y
    inverse_width = np.float32(1.0) / BUCKET_WIDTH
    goal_x, goal_y = goal % stride, goal // stride

    # 1. The open list: ring of buckets over a pool of entries (see grid_search). An estimate may be a whole line too
    #    low, so keys are clamped to the ring.
    ring = max(64, ring_size(table, 4.0))
    mask = ring - 1
    heads = np.full(ring, -1, dtype=np.int32)
    pool_cell = np.empty(1024, dtype=np.int32)
    pool_g = np.empty(1024, dtype=np.float32)
    pool_next = np.empty(1024, dtype=np.int32)
    used, free, waiting = 1, -1, 1
    g[start], parent[start] = 0.0, start
    bucket = int(_length(start % stride - goal_x, start // stride - goal_y) * inverse_width)
    pool_cell[0], pool_g[0], pool_next[0] = start, 0.0, -1
    heads[bucket & mask] = 0

    straight_open = np.zeros(4, dtype=np.bool_)
    polls = 0
    status = EXHAUSTED
    while waiting > 0 and status == EXHAUSTED:
        entry = heads[bucket & mask]
        if entry < 0:
            bucket += 1
            continue
        cell, g_cell = pool_cell[entry], pool_g[entry]
        heads[bucket & mask] = pool_next[entry]
        pool_next[entry] = free
        free = entry
        waiting -= 1
        if g_cell != g[cell] or settled[cell] != 0:
            continue
        polls += 1
        if polls % POLL_INTERVAL == 1 and cancel_flag[0] != 0:
            status = CANCELED
            break

        # 2. Check the credited line; take the best settled neighbour where that is better. Dearer cells wait again.
        origin = parent[cell]
        if cell != start:
            g_line = g[origin] + line_cost(cells, stride, table, origin, cell)
            if g_line > g_cell * np.float32(1.000001):
                neighbour, g_step = _best_settled(cells, stride, table, g, settled, cell)
                if g_step < g_line:
                    parent[cell], g_line = neighbour, g_step
            g[cell] = g_line
            origin = parent[cell]
        x, y = cell % stride, cell // stride
        f = g[cell] + _length(x - goal_x, y - goal_y)
        later = int(f * inverse_width) > bucket + 1
        if not later:
            settled[cell] = 1
            if cell == goal:
                status = FOUND
                break

        # 3. Credit the eight neighbours with a line from the cell's own parent (or put a dearer cell back: k < 1).
        here = table[cells[cell]]
        from_x, from_y = x - origin % stride, y - origin // stride
        from_origin = _length(from_x, from_y)
        if from_origin > LINE_LIMIT:
            origin, from_x, from_y, from_origin = cell, 0, 0, np.float32(0.0)
        for k in range(8):
            if later and k > 0:
                break
            neighbour = cell
            if not later:
                neighbour = cell + steps[k]
                traversal = np.float32(0.5) * (here + table[cells[neighbour]])
                if k < 4:
                    straight_open[k] = traversal < np.inf
                elif not (straight_open[k & 1] and straight_open[2 + ((k - 4) >> 1)]):
                    continue
                if settled[neighbour] != 0 or np.isinf(traversal):
                    continue
                growth = max(_length(from_x + STEP_X[k], from_y + STEP_Y[k]) - from_origin, np.float32(0.0))
                g_new = g[cell] + traversal * growth
                if g_new >= g[neighbour]:
                    continue
                g[neighbour], parent[neighbour] = g_new, origin
                f = g_new + _length(x + STEP_X[k] - goal_x, y + STEP_Y[k] - goal_y)
            slot = min(max(int(f * inverse_width), bucket), bucket + ring - 1) & mask
            if free >= 0:
                new = free
                free = pool_next[free]
            else:
                if used == pool_cell.size:
                    pool_cell = np.concatenate((pool_cell, np.empty_like(pool_cell)))
                    pool_g = np.concatenate((pool_g, np.empty_like(pool_g)))
                    pool_next = np.concatenate((pool_next, np.empty_like(pool_next)))
                new = used
                used += 1
            pool_cell[new], pool_g[new], pool_next[new] = neighbour, g[neighbour], heads[slot]
            heads[slot] = new
            waiting += 1
    return status, np.where(settled != 0, g, np.float32(np.inf)), parent
