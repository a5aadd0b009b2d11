"""Shortest paths on an 8-connected grid: A* with a bucketed open list, or Dijkstra's field of all cells.

When to use: the path from one cell to one goal, or the cost of all cells (``goal`` = -1): potentials (navfn's job, the
heuristic of ``hybrid_astar``). When not: any-angle paths (``theta_star``), turning circles (``hybrid_astar``).

The result is the exact optimum as soon as the current bucket's lower end reaches g(goal); see ``open_list``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.search.grid_path import trace_cells
from mbf_costmap_nav.kernels.search.open_list import RING, bucket_width, enlarged_if_full
from mbf_costmap_nav.kernels.search.padded_grid import INF, PaddedGrid, octile_distance
from mbf_costmap_nav.kernels.search.relaxing import relax_bucket, relax_interpolated
from mbf_costmap_nav.kernels.search.search_cells import (
    CAME_SHIFT,
    KEPT_BITS,
    SLOT_BITS,
    Box,
    Records,
    natural_steps,
    new_records,
    whole_grid,
    write_box,
)

FOUND, EXHAUSTED, CANCELED = 0, 1, 2
"""States of a finished search: goal settled; everything reachable settled; the cancel flag was seen."""

FIRST_CAPACITY, CELLS_PER_ENTRY = 4096, 512
"""Entries of a bucket at first, and on large grids one for so many cells."""
LARGEST_FLOAT = np.float32(np.finfo(np.float32).max)


def search(
    grid: PaddedGrid,
    start: int,
    goal: int,
    heuristic_scale: float,
    cut_corners: bool,
    interpolated: bool,
    cancel_flag: NDArray[np.uint8],
    records: Records | None = None,
    touched: Box | None = None,
    buckets: NDArray[np.int32] | None = None,
) -> tuple[int, NDArray[np.float32], NDArray[np.int32]]:
    """Settle cells around ``start`` until ``goal`` is settled, or everything reachable if it cannot be reached.

    Parameters
    ----------
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
    touched : (4,) int64, optional
        The box of records that an earlier search of this very grid has changed, so that only they are written anew;
        replaced with that of this search. All are written without it.
    buckets : (RING, m) int32, optional
        Memory for the open list, see ``new_buckets``.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    g : (n,) float32
        Cost from the start in traversal times cells, inf where not reached. Exact for settled cells, an upper bound
        at the boundary of the search. A view into the search's records, so not contiguous.
    path : (m,) int32
        Flat padded indices from the start to a goal that was found by steps, see ``trace_cells``; else none.
    """
    records = new_records(grid.cells.size) if records is None else records
    touched = whole_grid(grid.cells, grid.stride) if touched is None else touched
    buckets = new_buckets(grid.cells.size) if buckets is None else buckets
    status, path = _search_and_trace(
        grid,
        grid.cells.reshape(-1, grid.stride),
        records.view(np.uint64).reshape(-1, grid.stride),
        records,
        records["g"],
        start,
        goal,
        heuristic_scale,
        cut_corners,
        interpolated,
        cancel_flag,
        buckets,
        touched,
    )
    if heuristic_scale == 0.0 or cancel_flag[0] != 0:  # set while the records were written, it left some of them out
        touched[:] = whole_grid(grid.cells, grid.stride)
    return status, records["g"], path


def new_buckets(count: int) -> NDArray[np.int32]:
    """Memory for the open list of a search over ``count`` cells."""
    return np.empty((RING, max(FIRST_CAPACITY, count // CELLS_PER_ENTRY)), dtype=np.int32)


def new_search_memory(count: int) -> tuple[Records, NDArray[np.int32]]:
    """Records and buckets for searches over ``count`` cells."""
    return new_records(count), new_buckets(count)


@kernel
def _search_and_trace(
    grid: PaddedGrid,
    cells: NDArray[np.uint8],
    words: NDArray[np.uint64],
    records: Records,
    g: NDArray[np.float32],
    start: int,
    goal: int,
    heuristic_scale: float,
    cut_corners: bool,
    interpolated: bool,
    cancel_flag: NDArray[np.uint8],
    buckets: NDArray[np.int32],
    touched: Box,
) -> tuple[int, NDArray[np.int32]]:
    """Write the records of the touched box, which ``words`` are, too, search, and trace the path to the goal.

    ``cells`` are those of the grid by rows, ``g`` is that of the records. All in one, so that the interpreter's lock is
    given away once.
    """
    write_box(cells, words, cancel_flag, touched)
    _, stride, table = grid
    status = _search(
        records, stride, table, start, goal, heuristic_scale, cut_corners, interpolated, cancel_flag, buckets, touched
    )
    if status != FOUND or interpolated:
        return status, np.empty(0, dtype=np.int32)
    return status, trace_cells(grid, g, goal, cut_corners)[::-1].copy()


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
    touched: Box,
) -> int:
    """Fill ``g`` of the records, none of them reached, and return the status; ``buckets`` is any (RING, n).

    ``touched`` becomes the box of cells that were reached, where there is a heuristic.
    """
    halves = (np.float32(0.5) * table).astype(np.float32)
    side_limit = INF if cut_corners else LARGEST_FLOAT
    scale, columns = np.float32(heuristic_scale), np.uint32(stride)
    goal_x, goal_y = goal % stride, goal // stride
    natural = natural_steps(stride)

    # 1. The open list with the start in it. A step moves the key by its own cost and as much of the heuristic.
    width = bucket_width(table, 2.0)
    inverse_width = np.float32(1.0) / width
    counts = np.zeros(RING, dtype=np.int64)
    fresh, came = np.empty(8 * FIRST_CAPACITY, dtype=np.int32), np.empty(8 * FIRST_CAPACITY, dtype=np.uint8)
    records[start].g = 0.0
    bucket = int(scale * octile_distance(abs(start % stride - goal_x), abs(start // stride - goal_y)) * inverse_width)
    slot = bucket & (RING - 1)
    buckets[slot, 0], counts[slot] = start, 1
    records[start].state = (records[start].state & ~SLOT_BITS) | np.uint32(slot)
    waiting, status = 1, EXHAUSTED
    x_low, y_low = np.int32(start % stride), np.int32(start // stride)
    x_high, y_high = x_low, y_low

    while waiting > 0:
        # 2. Go on to the next bucket that is not empty; the goal is settled once no key can be below its g.
        slot = bucket & (RING - 1)
        if counts[slot] == 0:
            bucket += 1
            if goal >= 0 and np.float32(bucket) * width >= records[goal].g:
                break
            continue
        if cancel_flag[0] != 0:
            status = CANCELED
            break

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
        buckets = enlarged_if_full(buckets, counts, improved)
        for i in range(improved):
            cell = np.uint32(fresh[i])
            key = records[cell].g
            if scale > 0.0:
                y = np.int32(cell // columns)
                x = np.int32(cell - np.uint32(y) * columns)
                x_low, x_high, y_low, y_high = min(x_low, x), max(x_high, x), min(y_low, y), max(y_high, y)
                key += scale * octile_distance(abs(x - goal_x), abs(y - goal_y))
            slot = max(int(key * inverse_width), bucket) & (RING - 1)
            buckets[slot, counts[slot]] = cell
            state = records[cell].state
            is_new = np.int64(state & SLOT_BITS != slot)
            counts[slot] += is_new
            waiting += is_new
            records[cell].state = (state & KEPT_BITS) | (np.uint32(came[i]) << CAME_SHIFT) | np.uint32(slot)
    touched[0], touched[1], touched[2], touched[3] = x_low, y_low, x_high + 1, y_high + 1
    if status != CANCELED and goal >= 0 and records[goal].g < INF:
        return FOUND
    return status
