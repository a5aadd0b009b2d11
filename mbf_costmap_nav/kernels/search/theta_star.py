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

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, EXHAUSTED, FIRST_CAPACITY, FOUND
from mbf_costmap_nav.kernels.search.open_list import IDLE, RING, bucket_width, enlarged_if_full
from mbf_costmap_nav.kernels.search.padded_grid import CELLS_PER_POLL, INF, SQRT2, Integer, PaddedGrid, octile_distance
from mbf_costmap_nav.kernels.search.short_lines import (
    BASE,
    CROSSED,
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


@kernel
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


@kernel
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


@kernel
def _expand_bucket(
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


def theta_search(
    grid: PaddedGrid, start: int, goal: int, cancel_flag: NDArray[np.uint8]
) -> tuple[int, NDArray[np.float32], NDArray[np.uint8]]:
    """Settle cells from ``start`` until ``goal`` is settled.

    Parameters
    ----------
    grid, start, goal, cancel_flag
        As for ``grid_search.search``; the traversal of a free cell is 1 or more.

    Returns
    -------
    status : int
        FOUND, EXHAUSTED or CANCELED.
    g : (n,) float32
        Cost of the settled cells; inf for all others. Means nothing when cancelled, as ``origin``.
    origin : (n,) uint8
        Codes of where the straight line to a cell comes from, for ``trace_lines``.
    """
    count = grid.cells.size  # numpy's own arrays, for huge pages, as in grid_search
    labels = Labels(np.empty(count, dtype=np.float32), np.empty(count, dtype=np.uint8), np.empty(count, dtype=np.uint8))
    for begin in range(0, count, CELLS_PER_POLL):
        if cancel_flag[0] != 0:
            return CANCELED, labels.g, labels.origin
        block = slice(begin, begin + CELLS_PER_POLL)
        labels.g[block], labels.origin[block], labels.queued[block] = INF, HERE, IDLE
    return _search(grid, labels, start, goal, cancel_flag), labels.g, labels.origin


@kernel
def _search(grid: PaddedGrid, labels: Labels, start: int, goal: int, cancel_flag: NDArray[np.uint8]) -> int:
    """Fill ``g`` and ``origin`` of the labels, given full of inf, HERE and IDLE, and return the status."""
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
        credited = _expand_bucket(grid, labels, crossed, goal, upper_end, in_bucket, slot, fresh)
        waiting -= counts[slot]
        counts[slot] = 0

        # 4. Sort the credited cells into buckets by g + h; those settled meanwhile and not opened again drop out.
        buckets = enlarged_if_full(buckets, counts, credited)
        for i in range(credited):
            cell = np.uint32(fresh[i])
            if g[cell] <= 0.0 and queued[cell] != OPENED:
                continue
            y = cell // columns
            dx, dy = np.int32(cell - y * columns) - goal_x, np.int32(y) - goal_y
            key = abs(g[cell]) + octile_distance(abs(dx), abs(dy))
            slot = min(max(int(key * inverse_width), bucket), bucket + RING - 1) & (RING - 1)
            buckets[slot, counts[slot]] = cell
            is_new = np.int64(queued[cell] != slot)
            counts[slot] += is_new
            waiting += is_new
            queued[cell] = slot
    if status == CANCELED:
        return status
    if g[goal] <= 0.0:
        status = FOUND
    for i in range(np.uint64(g.size)):
        g[i] = -g[i] if g[i] <= 0.0 else INF
    return status
