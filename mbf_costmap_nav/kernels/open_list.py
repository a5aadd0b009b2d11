"""The open list of the grid searches: a ring of buckets of equal width, and the relaxing of what one bucket holds.

A bucket keeps the cells whose key (g, or g + h) lies in its interval (Dial 1969, Denardo and Fox 1979). Inside a bucket
the order is free; a cell whose g drops later is put back, so results are exact (label correcting, as in delta
stepping; Meyer and Sanders 2003).

Speed comes from two habits. A bucket is relaxed as a whole, and the cells that improved are sorted into buckets
afterwards, so the inner loop has one counter. And nothing in it is a branch: whether a neighbour improves is as good as
random, so an "if" would be mispredicted every other time. Hence every neighbour is written down in ``fresh`` and the
counter only moves on if it improved, and blocked cells simply cost inf.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel

RING = 128
"""Buckets of the ring; a power of two."""
IDLE = np.uint8(255)
"""State of a cell that waits in no bucket; any other value is the bucket's place in the ring."""
SQRT2 = np.float32(np.sqrt(2.0))
INF = np.float32(np.inf)

Integer = int | np.integer[Any]


@kernel
def bucket_width(table: NDArray[np.float32], steps: float) -> np.float32:
    """Width at which the ring holds a growth of the key by ``steps`` of the heaviest diagonal steps, at least 1.

    A step costs 1 or more, so at width 1 no cell falls back into the bucket it is reached from unless a heuristic
    takes the step's cost away again. Wider buckets, which only large costs need, stay exact but relax cells twice.
    """
    heaviest = table[table < INF].max()
    return np.float32(max(1.0, steps * SQRT2 * heaviest / (RING - 3)))


@kernel
def with_room(buckets: NDArray[np.int32], counts: NDArray[np.int64], added: Integer) -> NDArray[np.int32]:
    """Buckets (RING, capacity) in which each has room for ``added`` more; the given array if they have."""
    needed = counts.max() + added
    if needed <= buckets.shape[1]:
        return buckets
    larger = np.empty((RING, 2 * needed), dtype=np.int32)
    for slot in range(RING):
        larger[slot, : counts[slot]] = buckets[slot, : counts[slot]]
    return larger


@kernel
def _relax(
    g: NDArray[np.float32], fresh: NDArray[np.int32], count: np.uint64, neighbour: np.uint64, reached: np.float32
) -> np.uint64:
    """Lower ``g`` of a neighbour to ``reached`` and note it; returns the count of noted cells."""
    known = g[neighbour]
    g[neighbour] = min(reached, known)
    fresh[count] = neighbour
    return np.uint64(count + np.uint64(reached < known))


@kernel
def relax_bucket(
    cells: NDArray[np.uint8],
    stride: int,
    halves: NDArray[np.float32],
    side_limit: np.float32,
    waiting: NDArray[np.int32],
    slot: int,
    queued: NDArray[np.uint8],
    g: NDArray[np.float32],
    fresh: NDArray[np.int32],
) -> np.uint64:
    """Relax the eight neighbours of the cells of one bucket.

    Parameters
    ----------
    cells : (n,) uint8
        Flat padded costs, rows of ``stride``.
    halves : (256,) float32
        Half the traversal of each cost.
    side_limit : float32
        A diagonal step whose two side cells have halves that sum up to more is blocked: the largest finite number
        forbids to cut corners, inf allows it.
    waiting : (m,) int32
        What is in the bucket; cells whose state is not ``slot`` have been moved and are passed over.
    queued : (n,) uint8
        States of the cells; those relaxed become IDLE.
    g : (n,) float32
        Costs, lowered in place.
    fresh : (8 m or more,) int32
        Filled with the cells that improved, some of them several times.

    Returns
    -------
    count : uint64
        Entries of ``fresh``.
    """
    one, row, own = np.uint64(1), np.uint64(stride), np.uint8(slot)  # unsigned indices need no test for negative ones
    count = np.uint64(0)
    for i in range(np.uint64(waiting.size)):
        cell = np.uint64(waiting[i])
        if queued[cell] != own:
            continue
        queued[cell] = IDLE
        g_cell, here = g[cell], halves[cells[cell]]
        east, west = halves[cells[cell + one]], halves[cells[cell - one]]
        north, south = halves[cells[cell + row]], halves[cells[cell - row]]
        count = _relax(g, fresh, count, cell + one, g_cell + here + east)
        count = _relax(g, fresh, count, cell - one, g_cell + here + west)
        count = _relax(g, fresh, count, cell + row, g_cell + here + north)
        count = _relax(g, fresh, count, cell - row, g_cell + here + south)
        diagonal = g_cell + SQRT2 * (here + halves[cells[cell + row + one]])
        count = _relax(g, fresh, count, cell + row + one, diagonal if north + east <= side_limit else INF)
        diagonal = g_cell + SQRT2 * (here + halves[cells[cell + row - one]])
        count = _relax(g, fresh, count, cell + row - one, diagonal if north + west <= side_limit else INF)
        diagonal = g_cell + SQRT2 * (here + halves[cells[cell - row + one]])
        count = _relax(g, fresh, count, cell - row + one, diagonal if south + east <= side_limit else INF)
        diagonal = g_cell + SQRT2 * (here + halves[cells[cell - row - one]])
        count = _relax(g, fresh, count, cell - row - one, diagonal if south + west <= side_limit else INF)
    return count


@kernel
def relax_interpolated(
    cells: NDArray[np.uint8],
    stride: int,
    table: NDArray[np.float32],
    waiting: NDArray[np.int32],
    slot: int,
    queued: NDArray[np.uint8],
    g: NDArray[np.float32],
    fresh: NDArray[np.int32],
) -> np.uint64:
    """Lower the four neighbours of the cells of one bucket to navfn's interpolated potential.

    A cell's potential is interpolated between its lower neighbour along x and its lower one along y, as if a straight
    front came in between: with d = their difference by the cell's traversal, lower + traversal * v(d), where v is
    navfn's parabola through the wave's travel times. It exceeds 1, the way straight from the lower neighbour, by half
    a per cent as d comes near 1; cut off there it never falls with a neighbour's potential, so the order of updates
    does not matter. Parameters are those of ``relax_bucket``; ``table`` is the traversal itself.
    """
    one, row, own = np.uint64(1), np.uint64(stride), np.uint8(slot)
    full = np.float32(1.0)
    square, slope, least = np.float32(-0.2301), np.float32(0.5307), np.float32(0.7040)
    count = np.uint64(0)
    for i in range(np.uint64(waiting.size)):
        cell = np.uint64(waiting[i])
        if queued[cell] != own:
            continue
        queued[cell] = IDLE
        for neighbour in (cell + one, cell - one, cell + row, cell - row):
            traversal = table[cells[neighbour]]
            if traversal == INF:
                continue
            low_x, low_y = min(g[neighbour + one], g[neighbour - one]), min(g[neighbour + row], g[neighbour - row])
            d = min(abs(low_x - low_y) / traversal, full)
            share = min(least + d * (slope + d * square), full)
            count = _relax(g, fresh, count, neighbour, min(low_x, low_y) + traversal * share)
    return count
