"""Shortest paths on an 8-connected grid: A* with a bucketed open list, or Dijkstra's field of all cells.

When to use: the way from one cell to one goal, or the cost of all cells (``goal`` = -1): potentials (navfn's job, the
heuristic of ``hybrid_astar``). When not: any-angle paths (``theta_star``), turning circles (``hybrid_astar``).

The grid is handed over flat and padded by one blocked cell on every side, so the inner loop needs no border test.
Entering or leaving a cell costs half its *traversal* ``table[cost]`` per cell of length, so a step between cells a
and b of length L weighs ``L * (table[a] + table[b]) / 2``: symmetric, and infinite where one of them is blocked.

The result is the exact optimum as soon as the current bucket's lower end reaches g(goal); see ``open_list``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.search.open_list import INF, RING, SQRT2, Integer, bucket_width, with_room
from mbf_costmap_nav.kernels.search.relaxing import relax_bucket, relax_interpolated
from mbf_costmap_nav.kernels.search.search_cells import (
    CAME_SHIFT,
    KEPT_BITS,
    SLOT_BITS,
    Records,
    natural_steps,
    new_records,
    write_records,
)

FOUND, EXHAUSTED, CANCELED = 0, 1, 2
"""States of a finished search: goal settled; everything reachable settled; the cancel flag was seen."""

FIRST_ROOM, CELLS_PER_ROOM = 4096, 512
"""Entries each bucket has room for at first, and on large grids one for so many cells."""
CELLS_PER_POLL = 1 << 20
"""How many cells are copied between two looks at the cancel flag; at most a millisecond."""
NEVER_CANCELED = np.zeros(1, dtype=np.uint8)
LARGEST_FLOAT = np.float32(np.finfo(np.float32).max)


def pad_cells(
    cells: NDArray[np.uint8], border: int, cancel_flag: NDArray[np.uint8] = NEVER_CANCELED
) -> NDArray[np.uint8]:
    """Copy (height, width) cells into a flat ((height + 2) * (width + 2),) array framed by ``border``.

    With the flag set it ends early, and what is not copied yet holds anything; ``search`` then starts nowhere.
    """
    height, width = cells.shape
    padded = np.empty((height + 2, width + 2), dtype=np.uint8)
    padded[[0, -1]] = border
    rows = max(1, CELLS_PER_POLL // max(1, width))
    for begin in range(0, height, rows):
        if cancel_flag[0] != 0:
            break
        end = min(begin + rows, height)
        block = padded[1 + begin : 1 + end]  # the frame too, as the first touch of a page is what takes the time
        block[:, [0, -1]], block[:, 1:-1] = border, cells[begin:end]
    return padded.reshape(-1)


@kernel
def octile_distance(dx: Integer, dy: Integer) -> np.float32:
    """Length of the shortest 8-connected way over ``dx``, ``dy`` >= 0 free cells."""
    if dx < dy:
        dx, dy = dy, dx
    return np.float32(dx) + (SQRT2 - np.float32(1.0)) * np.float32(dy)


def search(
    cells: NDArray[np.uint8],
    stride: int,
    table: NDArray[np.float32],
    start: int,
    goal: int,
    heuristic_scale: float,
    cut_corners: bool,
    interpolated: bool,
    cancel_flag: NDArray[np.uint8],
    records: Records | None = None,
) -> tuple[int, NDArray[np.float32]]:
    """Settle cells around ``start`` until ``goal`` is settled, or everything reachable if it cannot be reached.

    Parameters
    ----------
    cells : (n,) uint8
        Flat padded costs, see ``pad_cells``.
    stride : int
        Row length of the padded grid.
    table : (256,) float32
        Traversal of each cost, at least 1; inf = blocked.
    start, goal : int
        Flat padded indices; ``goal`` = -1 settles everything reachable.
    heuristic_scale : float
        At most the least finite traversal; 0 is Dijkstra's order, and the only choice without a goal.
    cut_corners : bool
        Whether a diagonal step may pass a blocked cell at its side.
    interpolated : bool
        Fill ``g`` with navfn's interpolated potential instead of the cost of steps. It cuts no corners, as it spreads
        along rows and columns, and needs a ``heuristic_scale`` of 0: a cell's value may come from two neighbours, of
        which a heuristic settles one too late.
    cancel_flag : (1,) uint8
        Polled at every row of the preparation and at every bucket.
    records : (n,) CELL, optional
        Memory to work in; what an earlier search in it returned is overwritten. Without it the search has its own.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    g : (n,) float32
        Cost from the start in traversal times cells, inf where not reached. Exact for settled cells, an upper bound
        at the rim of the search. A view into the search's records, so not contiguous.
    """
    records = new_records(cells.size) if records is None else records
    write_records(cells, stride, cancel_flag, records)
    buckets = np.empty((RING, max(FIRST_ROOM, cells.size // CELLS_PER_ROOM)), dtype=np.int32)
    status = _search(
        records, stride, table, start, goal, heuristic_scale, cut_corners, interpolated, cancel_flag, buckets
    )
    return status, records["g"]


@kernel
def _search(
    records: Records,
    stride: int,
    table: NDArray[np.float32],
    start: int,
    goal: int,
    heuristic_scale: float,
    cut_corners: bool,
    interpolated: bool,
    cancel_flag: NDArray[np.uint8],
    buckets: NDArray[np.int32],
) -> int:
    """Fill ``g`` of the records, none of them reached, and return the status; ``buckets`` is any (RING, n)."""
    halves = (np.float32(0.5) * table).astype(np.float32)
    side_limit = INF if cut_corners else LARGEST_FLOAT
    scale, columns = np.float32(heuristic_scale), np.uint32(stride)
    goal_x, goal_y = goal % stride, goal // stride
    natural = natural_steps(stride)

    # 1. The open list with the start in it. A step moves the key by its own cost and as much of the heuristic.
    width = bucket_width(table, 2.0)
    inverse_width = np.float32(1.0) / width
    counts = np.zeros(RING, dtype=np.int64)
    fresh, came = np.empty(8 * FIRST_ROOM, dtype=np.int32), np.empty(8 * FIRST_ROOM, dtype=np.uint8)
    records[start].g = 0.0
    bucket = int(scale * octile_distance(abs(start % stride - goal_x), abs(start // stride - goal_y)) * inverse_width)
    slot = bucket & (RING - 1)
    buckets[slot, 0], counts[slot] = start, 1
    records[start].state = (records[start].state & ~SLOT_BITS) | np.uint32(slot)
    waiting = 1

    while waiting > 0:
        # 2. Go on to the next bucket that is not empty; the goal is settled once no key can be below its g.
        slot = bucket & (RING - 1)
        if counts[slot] == 0:
            bucket += 1
            if goal >= 0 and np.float32(bucket) * width >= records[goal].g:
                return FOUND
            continue
        if cancel_flag[0] != 0:
            return CANCELED

        # 3. Relax all of it.
        if fresh.size < 8 * counts[slot]:
            fresh, came = np.empty(16 * counts[slot], dtype=np.int32), np.empty(16 * counts[slot], dtype=np.uint8)
        in_bucket = buckets[slot, : counts[slot]]
        if interpolated:
            improved = relax_interpolated(records, stride, table, in_bucket, slot, fresh, came)
        else:
            improved = relax_bucket(records, stride, halves, side_limit, natural, in_bucket, slot, fresh, came)
        waiting -= counts[slot]
        counts[slot] = 0

        # 4. Sort the improved cells into buckets by g + h; a cell that already waits there is not added again. The last
        #    improvement of a cell is its best one, so the last step to it stands.
        buckets = with_room(buckets, counts, improved)
        for i in range(improved):
            cell = np.uint32(fresh[i])
            key = records[cell].g
            if scale > 0.0:
                y = cell // columns
                x = cell - y * columns
                key += scale * octile_distance(abs(np.int32(x) - goal_x), abs(np.int32(y) - goal_y))
            slot = max(int(key * inverse_width), bucket) & (RING - 1)
            buckets[slot, counts[slot]] = cell
            state = records[cell].state
            is_new = np.int64(state & SLOT_BITS != slot)
            counts[slot] += is_new
            waiting += is_new
            records[cell].state = (state & KEPT_BITS) | (np.uint32(came[i]) << CAME_SHIFT) | np.uint32(slot)
    return FOUND if goal >= 0 and records[goal].g < INF else EXHAUSTED
