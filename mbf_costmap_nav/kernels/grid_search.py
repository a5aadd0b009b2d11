"""Shortest paths on an 8-connected grid: A* with a bucketed open list.

When to use: the way from one cell to one goal. When not: the cost of all cells (``grid_field``), any-angle paths
(``theta_star``), turning circles (``hybrid_astar``).

The grid is handed over flat and padded by one blocked cell on every side, so the inner loop needs no border test.
Entering or leaving a cell costs half its *traversal* ``table[cost]`` per cell of length, so a step between cells a
and b of length L weighs ``L * (table[a] + table[b]) / 2``: symmetric, and infinite where one of them is blocked.

The open list is a ring of buckets of equal width in f = g + h (Dial 1969, Denardo and Fox 1979) whose entries are
chained through one recycled pool. Inside a bucket the order is free; a cell whose g drops later is pushed again, so
the result is the exact optimum as soon as the current bucket's lower end reaches g(goal) (label correcting, as in
delta stepping; Meyer and Sanders 2003).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel

FOUND, EXHAUSTED, CANCELED = 0, 1, 2
"""States of a finished search: goal settled; everything reachable settled; the cancel flag was seen."""

BUCKET_WIDTH = np.float32(0.5)
POLL_INTERVAL = 4096
STEP_X = np.array([1, -1, 0, 0, 1, -1, 1, -1])
STEP_Y = np.array([0, 0, 1, -1, 1, 1, -1, -1])
SQRT2 = np.float32(np.sqrt(2.0))


@kernel
def pad_cells(cells: NDArray[np.uint8], border: int) -> NDArray[np.uint8]:
    """Copy (height, width) cells into a flat ((height + 2) * (width + 2),) array framed by ``border``."""
    height, width = cells.shape
    padded = np.full((height + 2, width + 2), np.uint8(border), dtype=np.uint8)
    padded[1:-1, 1:-1] = cells
    return padded.reshape(-1)


@kernel
def octile_distance(dx: int, dy: int) -> np.float32:
    """Length of the shortest 8-connected way over ``dx``, ``dy`` >= 0 free cells."""
    if dx < dy:
        dx, dy = dy, dx
    return np.float32(dx) + (SQRT2 - np.float32(1.0)) * np.float32(dy)


@kernel
def ring_size(table: NDArray[np.float32], steps: float) -> int:
    """Buckets, a power of two, that hold a growth of f by ``steps`` of the heaviest diagonal steps."""
    heaviest = np.float32(0.0)
    for traversal in table:
        if traversal < np.inf:
            heaviest = max(heaviest, traversal)
    ring = 4
    while ring < steps * SQRT2 * heaviest / BUCKET_WIDTH + 4.0:
        ring *= 2
    return ring


@kernel
def search(
    cells: NDArray[np.uint8],
    stride: int,
    table: NDArray[np.float32],
    start: int,
    goal: int,
    heuristic_scale: float,
    cut_corners: bool,
    cancel_flag: NDArray[np.uint8],
) -> tuple[int, NDArray[np.float32]]:
    """Settle cells around ``start`` until ``goal`` is settled, or everything reachable if it cannot be reached.

    Parameters
    ----------
    cells : (n,) uint8
        Flat padded costs, see ``pad_cells``.
    stride : int
        Row length of the padded grid.
    table : (256,) float32
        Traversal of each cost, at least ``heuristic_scale``; inf = blocked.
    start, goal : int
        Flat padded indices.
    heuristic_scale : float
        At most the least finite traversal; 0 is Dijkstra's order.
    cut_corners : bool
        Whether a diagonal step may pass a blocked cell at its side.
    cancel_flag : (1,) uint8
        Polled every few thousand cells.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    g : (n,) float32
        Cost from the start in traversal times cells, inf where not reached. Exact for settled cells, an upper bound
        at the rim of the search.
    """
    g = np.full(cells.size, np.float32(np.inf), dtype=np.float32)
    steps = STEP_X + stride * STEP_Y
    halves = (np.float32(0.5) * table).astype(np.float32)
    goal_y, goal_x = goal // stride, goal % stride
    scale = np.float32(heuristic_scale)
    inverse_width = np.float32(1.0) / BUCKET_WIDTH

    # 1. The ring must hold the largest growth of f in one step: twice the heaviest step.
    ring = ring_size(table, 2.0)
    heads = np.full(ring, -1, dtype=np.int32)
    mask = ring - 1

    # 2. The pool of open entries: cell, its g when pushed, next entry of the bucket; freed entries are reused.
    pool_cell = np.empty(1024, dtype=np.int32)
    pool_g = np.empty(1024, dtype=np.float32)
    pool_next = np.empty(1024, dtype=np.int32)
    used, free, waiting = 1, -1, 1
    g[start] = 0.0
    h = scale * octile_distance(abs(start % stride - goal_x), abs(start // stride - goal_y))
    bucket = int(h * inverse_width)
    pool_cell[0], pool_g[0], pool_next[0] = start, 0.0, -1
    heads[bucket & mask] = 0

    open_straight = np.zeros(4, dtype=np.bool_)
    polls = 0
    while waiting > 0:
        entry = heads[bucket & mask]
        if entry < 0:
            bucket += 1
            if np.float32(bucket) * BUCKET_WIDTH >= g[goal]:
                return FOUND, g
            continue
        # 3. Take an entry out; it is stale if its cell has been improved since.
        cell, g_cell = pool_cell[entry], pool_g[entry]
        heads[bucket & mask] = pool_next[entry]
        pool_next[entry] = free
        free = entry
        waiting -= 1
        if g_cell != g[cell]:
            continue
        if polls % POLL_INTERVAL == 0 and cancel_flag[0] != 0:
            return CANCELED, g
        polls += 1
        y = cell // stride
        x = cell - y * stride
        here = halves[cells[cell]]

        # 4. Relax the four straight and then the four diagonal neighbours.
        for k in range(8):
            neighbour = cell + steps[k]
            half = halves[cells[neighbour]]
            if k < 4:
                open_straight[k] = half < np.inf
                g_new = g_cell + here + half
            else:
                if not cut_corners and not (open_straight[(k & 1)] and open_straight[2 + ((k - 4) >> 1)]):
                    continue
                g_new = g_cell + SQRT2 * (here + half)
            if g_new >= g[neighbour]:
                continue
            g[neighbour] = g_new
            f = g_new + scale * octile_distance(abs(x + STEP_X[k] - goal_x), abs(y + STEP_Y[k] - goal_y))
            slot = max(int(f * inverse_width), bucket) & mask
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
            pool_cell[new], pool_g[new], pool_next[new] = neighbour, g_new, heads[slot]
            heads[slot] = new
            waiting += 1
    return (FOUND if g[goal] < np.inf else EXHAUSTED), g
