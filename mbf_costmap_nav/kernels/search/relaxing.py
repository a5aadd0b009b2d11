"""Relaxing what one bucket of the grid search holds: the cost of eight-connected steps, or navfn's potential.

Both write down every neighbour they look at and count only those that improved; ``open_list`` explains why.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, inner_kernel, plain_kernel
from mbf_costmap_nav.kernels.search.open_list import IDLE
from mbf_costmap_nav.kernels.search.padded_grid import INF, SQRT2
from mbf_costmap_nav.kernels.search.search_cells import (
    CAME_BITS,
    CAME_SHIFT,
    COST_BITS,
    COST_SHIFT,
    NOWHERE,
    PLAIN,
    SLOT_BITS,
    Records,
)


@inner_kernel
def _traversal(records: Records, table: NDArray[np.float32], cell: np.uint64) -> np.float32:
    """Look up what a cell's cost makes of a step, in the whole traversal or in halves of it."""
    traversal: np.float32 = table[(records[cell].state >> COST_SHIFT) & COST_BITS]
    return traversal


@plain_kernel
def _relax(
    records: Records,
    fresh: NDArray[np.int32],
    came: NDArray[np.uint8],
    count: np.uint64,
    neighbour: np.uint64,
    reached: np.float32,
    direction: int,
) -> np.uint64:
    """Lower ``g`` of a neighbour to ``reached`` and note it with its step; returns the count of noted cells."""
    known = records[neighbour].g
    records[neighbour].g = min(reached, known)
    fresh[count], came[count] = neighbour, direction
    return np.uint64(count + np.uint64(reached < known))


@inner_kernel
def relax_bucket(
    records: Records,
    stride: int,
    halves: NDArray[np.float32],
    side_limit: np.float32,
    natural: NDArray[np.uint64],
    waiting: NDArray[np.int32],
    slot: int,
    fresh: NDArray[np.int32],
    came: NDArray[np.uint8],
) -> np.uint64:
    """Relax the neighbours of the cells of one bucket.

    All eight, but of a *plain* cell, whose neighbours all have its own cost, only its natural ones: straight on, and
    after a diagonal step also along its two axes. Every other neighbour is reached from the cell before over another
    cell of the nine for the same cost or less; where it is the same, the path with the diagonal first is kept, so no
    two cells leave a third to each other (canonical orderings, Sturtevant and Rabin 2016, after the jump point search
    of Harabor and Grastien 2011).

    Parameters
    ----------
    records : (n,) CELL
        Padded grid, rows of ``stride``; ``g`` is lowered in place, cells that are relaxed become IDLE.
    halves : (256,) float32
        Half the traversal of each cost.
    side_limit : float32
        A diagonal step whose two side cells have halves that sum up to more is blocked: the largest finite number
        forbids to cut corners, inf allows it.
    natural : (8, 3) uint64
        See ``natural_steps``.
    waiting : (m,) int32
        What is in the bucket; cells whose state is not ``slot`` have been moved and are passed over.
    fresh, came : (8 m or more,) int32, uint8
        Filled with the cells that improved, some of them several times, and the directions of the steps to them.

    Returns
    -------
    count : uint64
        Entries of ``fresh`` and ``came``.
    """
    one, row, own = np.uint64(1), np.uint64(stride), np.uint32(slot)  # unsigned indices need no test for negative ones
    count = np.uint64(0)
    for i in range(np.uint64(waiting.size)):
        cell = np.uint64(waiting[i])
        state = records[cell].state
        if state & SLOT_BITS != own:
            continue
        records[cell].state = state | IDLE
        g_cell, here = records[cell].g, halves[(state >> COST_SHIFT) & COST_BITS]
        direction = (state >> CAME_SHIFT) & CAME_BITS
        if state & PLAIN != 0 and direction != NOWHERE:
            step = here + here
            if direction < 4:
                count = _relax(
                    records, fresh, came, count, cell + natural[direction, 0], g_cell + step, Count(direction)
                )
            else:
                ahead, along_x, along_y = natural[direction]
                in_x, in_y = direction & np.uint32(1), np.uint32(2) | (direction & np.uint32(2)) >> np.uint32(1)
                count = _relax(records, fresh, came, count, cell + ahead, g_cell + SQRT2 * step, Count(direction))
                count = _relax(records, fresh, came, count, cell + along_x, g_cell + step, Count(in_x))
                count = _relax(records, fresh, came, count, cell + along_y, g_cell + step, Count(in_y))
            continue
        east, west = _traversal(records, halves, cell + one), _traversal(records, halves, cell - one)
        north, south = _traversal(records, halves, cell + row), _traversal(records, halves, cell - row)
        count = _relax(records, fresh, came, count, cell + one, g_cell + here + east, Count(0))
        count = _relax(records, fresh, came, count, cell - one, g_cell + here + west, Count(1))
        count = _relax(records, fresh, came, count, cell + row, g_cell + here + north, Count(2))
        count = _relax(records, fresh, came, count, cell - row, g_cell + here + south, Count(3))
        for neighbour, sides, direction in (
            (cell + row + one, north + east, 4),
            (cell + row - one, north + west, 5),
            (cell - row + one, south + east, 6),
            (cell - row - one, south + west, 7),
        ):
            diagonal = g_cell + SQRT2 * (here + _traversal(records, halves, neighbour))
            count = _relax(
                records, fresh, came, count, neighbour, diagonal if sides <= side_limit else INF, Count(direction)
            )
    return count


@inner_kernel
def relax_interpolated(
    records: Records,
    stride: int,
    table: NDArray[np.float32],
    waiting: NDArray[np.int32],
    slot: int,
    fresh: NDArray[np.int32],
    came: NDArray[np.uint8],
) -> np.uint64:
    """Lower the four neighbours of the cells of one bucket to navfn's interpolated potential.

    A cell's potential is interpolated between its lower neighbour along x and its lower one along y, as if a straight
    front came in between: with d = their difference by the cell's traversal, lower + traversal * v(d), where v is
    navfn's parabola through the wave's travel times. It exceeds 1, the straight step from the lower neighbour, by half
    a per cent as d comes near 1; cut off there it never falls with a neighbour's potential, so the order of updates
    does not matter. Parameters are those of ``relax_bucket``; ``table`` is the traversal itself, and ``came`` is
    filled with NOWHERE, as a value comes from two neighbours.
    """
    one, row, own = np.uint64(1), np.uint64(stride), np.uint32(slot)
    full = np.float32(1.0)
    square, slope, least = np.float32(-0.2301), np.float32(0.5307), np.float32(0.7040)
    count = np.uint64(0)
    for i in range(np.uint64(waiting.size)):
        cell = np.uint64(waiting[i])
        state = records[cell].state
        if state & SLOT_BITS != own:
            continue
        records[cell].state = state | IDLE
        for neighbour in (cell + one, cell - one, cell + row, cell - row):
            traversal = _traversal(records, table, neighbour)
            if traversal == INF:
                continue
            low_x = min(records[neighbour + one].g, records[neighbour - one].g)
            low_y = min(records[neighbour + row].g, records[neighbour - row].g)
            d = min(abs(low_x - low_y) / traversal, full)
            share = min(least + d * (slope + d * square), full)
            reached = min(low_x, low_y) + traversal * share
            count = _relax(records, fresh, came, count, neighbour, reached, Count(NOWHERE))
    return count
