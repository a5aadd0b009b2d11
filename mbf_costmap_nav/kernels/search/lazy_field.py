"""The field of costs from one cell over a grid, worked out only as far as it is asked for.

When to use: a search that asks for the costs of the cells around its own way, as ``hybrid_astar`` does, so that most of
a large map is never looked at. When not: the costs of all cells, for which ``grid_search`` has less to keep.

It grows like A* toward one cell: first where the path between both is, and from there to whatever is asked for. Costs
are exact once the bucket in turn can lower none of them any more, whatever was asked for before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, kernel
from mbf_costmap_nav.kernels.search.open_list import RING, bucket_width, enlarged_if_full
from mbf_costmap_nav.kernels.search.padded_grid import INF, octile_distance
from mbf_costmap_nav.kernels.search.relaxing import relax_bucket
from mbf_costmap_nav.kernels.search.search_cells import (
    CAME_SHIFT,
    KEPT_BITS,
    SLOT_BITS,
    Box,
    Records,
    natural_steps,
    write_box,
)

BUCKET, WAITING = 0, 1
"""Where ``progress`` holds the number of the bucket in turn, and how many cells wait."""


class FieldMemory(NamedTuple):
    """A padded grid and the memory for one field over it.

    Attributes
    ----------
    cells : (height, width) uint8
        Costs with their padding.
    words : (height, width) uint64
        What ``records`` is, as words.
    records : (height * width,) CELL
    table : (256,) float32
        Traversal of each cost, at least 1; inf = blocked.
    buckets : (RING, m) int32
        Memory for the open list.
    touched : (4,) int64
        The box of records that the field before has changed; it becomes that of this one.
    """

    cells: NDArray[np.uint8]
    words: NDArray[np.uint64]
    records: Records
    table: NDArray[np.float32]
    buckets: NDArray[np.int32]
    touched: Box


class LazyField(NamedTuple):
    """A field that grows.

    Attributes
    ----------
    records : (n,) CELL
        Padded grid.
    stride : int
        Length of its rows.
    toward : int
        Flat index of the cell that it grows to first.
    width : float
        Of a bucket.
    halves : (256,) float32
        Half the traversal of each cost.
    natural : (8, 3) uint64
        See ``natural_steps``.
    progress : (2,) int64
        ``BUCKET`` and ``WAITING``.
    counts : (RING,) int64
        Entries of the buckets.
    buckets : list of one (RING, m) int32
        The open list; another array where it has grown.
    touched : (4,) int64
        Half-open box of what it has reached.
    cancel_flag : (1,) uint8
    """

    records: Records
    stride: int
    toward: int
    width: np.float32
    halves: NDArray[np.float32]
    natural: NDArray[np.uint64]
    progress: NDArray[np.int64]
    counts: NDArray[np.int64]
    buckets: list[NDArray[np.int32]]
    touched: Box
    cancel_flag: NDArray[np.uint8]


@kernel
def new_field(memory: FieldMemory, source: int, toward: int, cancel_flag: NDArray[np.uint8]) -> LazyField:
    """Field of costs from a cell; both are flat padded indices. Steps may cut the corners of blocked cells."""
    write_box(memory.cells, memory.words, cancel_flag, memory.touched)
    stride, records = memory.cells.shape[1], memory.records
    halves = (np.float32(0.5) * memory.table).astype(np.float32)
    width = bucket_width(memory.table, 2.0)
    progress, counts = np.zeros(2, dtype=np.int64), np.zeros(RING, dtype=np.int64)
    x, y = source % stride, source // stride
    bucket = int(octile_distance(abs(x - toward % stride), abs(y - toward // stride)) / width)
    slot = bucket & (RING - 1)
    memory.buckets[slot, 0], counts[slot] = source, 1
    records[source].g = 0.0
    records[source].state = (records[source].state & ~SLOT_BITS) | np.uint32(slot)
    progress[BUCKET], progress[WAITING] = bucket, 1
    touched = memory.touched
    touched[0], touched[1], touched[2], touched[3] = x, y, x + 1, y + 1
    return LazyField(
        records,
        stride,
        toward,
        width,
        halves,
        natural_steps(stride),
        progress,
        counts,
        [memory.buckets],
        touched,
        cancel_flag,
    )


@kernel
def field_cost(field: LazyField, cell: int) -> np.float32:
    """Cost to a cell, a flat padded index, in traversal times cells; inf where there is no path, or it was canceled."""
    x, y = cell % field.stride, cell // field.stride
    rest = octile_distance(abs(x - field.toward % field.stride), abs(y - field.toward // field.stride))
    while field.progress[WAITING] > 0:
        if np.float32(field.progress[BUCKET]) * field.width >= field.records[cell].g + rest:
            break
        if field.cancel_flag[0] != 0:
            return INF
        if field.counts[field.progress[BUCKET] & (RING - 1)] == 0:
            field.progress[BUCKET] += 1
        else:
            _settle_bucket(field)
    cost: np.float32 = field.records[cell].g
    return cost


@kernel
def _settle_bucket(field: LazyField) -> None:
    """Relax the bucket in turn, and put the cells that improved into theirs, as in ``grid_search``."""
    records, columns, counts, touched = field.records, np.uint32(field.stride), field.counts, field.touched
    bucket = field.progress[BUCKET]
    slot = bucket & (RING - 1)
    goal_x, goal_y = field.toward % field.stride, field.toward // field.stride
    in_bucket = field.buckets[0][slot, : counts[slot]]
    fresh, came = np.empty(8 * counts[slot], dtype=np.int32), np.empty(8 * counts[slot], dtype=np.uint8)
    improved = relax_bucket(records, field.stride, field.halves, INF, field.natural, in_bucket, slot, fresh, came)
    waiting = field.progress[WAITING] - counts[slot]
    counts[slot] = 0
    buckets = enlarged_if_full(field.buckets[0], counts, improved)
    field.buckets[0] = buckets
    x_low, y_low, x_high, y_high = touched[0], touched[1], touched[2] - 1, touched[3] - 1
    for i in range(improved):
        cell = np.uint32(fresh[i])
        y = np.int64(cell // columns)
        x = np.int64(cell) - y * field.stride
        x_low, x_high, y_low, y_high = min(x_low, x), max(x_high, x), min(y_low, y), max(y_high, y)
        key = records[cell].g + octile_distance(abs(x - goal_x), abs(y - goal_y))
        place = max(int(key / field.width), bucket) & (RING - 1)
        buckets[place, counts[place]] = cell
        state = records[cell].state
        is_new = Count(state & SLOT_BITS != place)
        counts[place] += is_new
        waiting += is_new
        records[cell].state = (state & KEPT_BITS) | (np.uint32(came[i]) << CAME_SHIFT) | np.uint32(place)
    touched[0], touched[1], touched[2], touched[3] = x_low, y_low, x_high + 1, y_high + 1
    field.progress[WAITING] = waiting
