"""Lazy Theta*: any-angle paths on a padded grid, one line of sight per settled cell.

When to use: short paths of few straight pieces. When not: an exact any-angle optimum (Theta* is a heuristic, usually
within 1 %), or where the eight directions do (``grid_search`` is twice as fast).

A neighbour is first credited with a straight line from its parent's parent, unchecked; the line is looked at when the
neighbour is about to be settled. If it is blocked or expensive, the best settled neighbour becomes the parent instead
(Nash, Koenig, Tovey 2010, Lazy Theta*). Deviations: on weighted cells the line's cost is integrated exactly, and a cell
that costs more than credited is put back into the open list. A settled cell is opened again if a single step from a
neighbour improves it, so the result never costs more than the 8-connected optimum (to 1e-6 a step). For that bound the
octile distance is heuristic enough; it overestimates any-angle paths by up to 8 %, which makes paths 0.1 % longer than
the Euclidean distance would, and settles a fifth fewer cells.

Lines end after ``LINE_LIMIT`` cells, so there are only 25 of them: what each crosses stands in a table, a parent is
remembered as one byte, and ``grid_line.pull_string`` joins the pieces afterwards. The open list, and why there are no
branches in the inner loop, is explained in ``open_list``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, EXHAUSTED, FIRST_CAPACITY, FOUND
from mbf_costmap_nav.kernels.search.open_list import IDLE, RING, bucket_width, enlarged_if_full
from mbf_costmap_nav.kernels.search.padded_grid import CELLS_PER_POLL, INF, PaddedGrid, octile_distance
from mbf_costmap_nav.kernels.search.search_cells import Box, whole_grid
from mbf_costmap_nav.kernels.search.short_lines import CROSSED, HERE
from mbf_costmap_nav.kernels.search.theta_expansion import OPENED, Labels, expand_bucket


def new_labels(count: int) -> Labels:
    """Memory for the labels of ``count`` cells that hold anything."""
    # numpy's own arrays, for huge pages, as in grid_search
    return Labels(np.empty(count, dtype=np.float32), np.empty(count, dtype=np.uint8), np.empty(count, dtype=np.uint8))


def theta_search(
    grid: PaddedGrid,
    start: int,
    goal: int,
    cancel_flag: NDArray[np.uint8],
    labels: Labels | None = None,
    touched: Box | None = None,
) -> tuple[int, NDArray[np.float32], NDArray[np.uint8]]:
    """Settle cells from ``start`` until ``goal`` is settled.

    Parameters
    ----------
    grid, start, goal, cancel_flag
        As for ``grid_search.search``; the traversal of a free cell is 1 or more.
    labels, touched
        As ``records`` and ``touched`` there.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    g : (n,) float32
        Cost of the settled cells; inf for all others. Means nothing when cancelled, as ``origin``.
    origin : (n,) uint8
        Codes of where the straight line to a cell comes from, for ``trace_lines``.
    """
    labels = new_labels(grid.cells.size) if labels is None else labels
    whole = whole_grid(grid.cells, grid.stride)
    touched = whole.copy() if touched is None else touched
    x0, y0, x1, y1 = touched.tolist()
    rows = max(1, CELLS_PER_POLL // grid.stride)
    for begin in range(y0, y1, rows):
        if cancel_flag[0] != 0:
            touched[:] = whole
            return CANCELED, labels.g, labels.origin
        part = slice(begin, min(begin + rows, y1)), slice(x0, x1)
        labels.g.reshape(-1, grid.stride)[part] = INF
        labels.origin.reshape(-1, grid.stride)[part] = HERE
        labels.queued.reshape(-1, grid.stride)[part] = IDLE
    return _search(grid, labels, start, goal, cancel_flag, touched), labels.g, labels.origin


@kernel
def _search(
    grid: PaddedGrid, labels: Labels, start: int, goal: int, cancel_flag: NDArray[np.uint8], touched: Box
) -> int:
    """Fill ``g`` and ``origin`` of the labels, given full of inf, HERE and IDLE, and return the status.

    ``touched`` becomes the box of cells that were reached.
    """
    stride, (g, _, queued) = grid.stride, labels
    columns = np.uint32(stride)
    goal_x, goal_y = goal % stride, goal // stride
    crossed = (CROSSED[:, :, 0] + stride * CROSSED[:, :, 1]).astype(np.uint64)

    # 1. The open list (see grid_search). A line may cost more than the ring holds, so keys are clamped to it.
    width = bucket_width(grid.table, 4.0)
    inverse_width = np.float32(1.0) / width
    buckets, counts = np.empty((RING, FIRST_CAPACITY), dtype=np.int32), np.zeros(RING, dtype=np.int64)
    fresh = np.empty(8 * FIRST_CAPACITY, dtype=np.int32)
    g[start] = 0.0
    bucket = int(octile_distance(abs(start % stride - goal_x), abs(start // stride - goal_y)) * inverse_width)
    slot = bucket & (RING - 1)
    buckets[slot, 0], counts[slot], queued[start] = start, 1, slot
    waiting = 1
    x_low, y_low = np.int32(start % stride), np.int32(start // stride)
    x_high, y_high = x_low, y_low

    status = EXHAUSTED
    while waiting > 0:
        # 2. Go on to the next bucket that is not empty.
        slot = bucket & (RING - 1)
        if counts[slot] == 0:
            bucket += 1
            if g[goal] <= 0.0 and np.float32(bucket) * width >= -g[goal]:
                break
            continue
        if cancel_flag[0] != 0:
            status = CANCELED
            break

        # 3. Settle what is in it.
        if fresh.size < 8 * counts[slot]:
            fresh = np.empty(16 * counts[slot], dtype=np.int32)
        in_bucket, upper_end = buckets[slot, : counts[slot]], np.float32(bucket + 2) * width
        credited = expand_bucket(grid, labels, crossed, goal, upper_end, in_bucket, slot, fresh)
        waiting -= counts[slot]
        counts[slot] = 0

        # 4. Sort the credited cells into buckets by g + h; those settled meanwhile and not opened again drop out.
        buckets = enlarged_if_full(buckets, counts, credited)
        for i in range(credited):
            cell = np.uint32(fresh[i])
            y = np.int32(cell // columns)
            x = np.int32(cell - np.uint32(y) * columns)
            x_low, x_high, y_low, y_high = min(x_low, x), max(x_high, x), min(y_low, y), max(y_high, y)
            if g[cell] <= 0.0 and queued[cell] != OPENED:
                continue
            key = abs(g[cell]) + octile_distance(abs(x - goal_x), abs(y - goal_y))
            slot = min(max(int(key * inverse_width), bucket), bucket + RING - 1) & (RING - 1)
            buckets[slot, counts[slot]] = cell
            is_new = np.int64(queued[cell] != slot)
            counts[slot] += is_new
            waiting += is_new
            queued[cell] = slot
    touched[0], touched[1], touched[2], touched[3] = x_low, y_low, x_high + 1, y_high + 1
    if status == CANCELED:
        return status
    if g[goal] <= 0.0:
        status = FOUND
    for row in range(y_low, y_high + 1):
        in_row = g[row * stride + x_low : row * stride + x_high + 1]
        for i in range(len(in_row)):
            in_row[i] = -in_row[i] if in_row[i] <= 0.0 else INF
    return status
