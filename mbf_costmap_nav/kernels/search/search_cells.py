"""The grid as the grid search sees it: all it asks about a cell side by side in eight bytes.

A wave over a large map is bound by memory: costs, states and g in three arrays mean nine cache lines for a cell and its
neighbours, one array of records means four. On 4000^2 cells that is a third of the time.

The second half of a record is one word of bits, so that one load answers everything:

======  ==========  ==================================================================================================
bits    name        meaning
======  ==========  ==================================================================================================
0-7     slot        where in the ring of buckets the cell waits, or ``IDLE``
8-11    came        direction of the step it was reached by, 0-7 in the order of ``DIRECTIONS``, or ``NOWHERE``
15      ``PLAIN``   its eight neighbours have the very same cost
16-23   cost        its cost
======  ==========  ==================================================================================================
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel, plain_kernel
from mbf_costmap_nav.kernels.search.open_list import IDLE

CELL = np.dtype([("g", np.float32), ("state", np.uint32)])
"""A cell: cost from the start, inf where not reached, and the word of bits above."""
Records = np.ndarray[Any, np.dtype[np.void]]
Box = NDArray[np.int64]
"""Half-open box (4,) of columns and rows of a padded grid: x0, y0, x1, y1."""

DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
"""Steps (x, y) to the neighbours: straight ones first, then a diagonal for each pair of them."""
NOWHERE = np.uint32(8)
"""Direction of a cell that was not reached by a step: the start."""
SLOT_BITS, CAME_BITS, CAME_SHIFT = np.uint32(0xFF), np.uint32(0xF), np.uint32(8)
PLAIN, COST_SHIFT, COST_BITS = np.uint32(1 << 15), np.uint32(16), np.uint32(0xFF)
KEPT_BITS = np.uint32(~0xFFF & 0xFFFFFFFF)
"""What stays in the word when a cell is put into a bucket."""

_UNTOUCHED = np.uint64(int(NOWHERE << CAME_SHIFT) | int(IDLE)) << np.uint64(32) | np.uint64(0x7F800000)
"""A record without its cost: waits nowhere, reached from nowhere, and g = inf (its bits)."""


def new_records(count: int) -> Records:
    """Memory for ``count`` records that hold anything."""
    # numpy's own array, not the kernel's: numpy asks the system for huge pages, and a wave touches many pages at once.
    return np.empty(count, dtype=CELL)


def whole_grid(cells: NDArray[np.uint8], stride: int) -> Box:
    """The box of all cells of a padded grid."""
    return np.array([0, 0, stride, cells.size // stride], dtype=np.int64)


@plain_kernel
def write_box(cells: NDArray[np.uint8], words: NDArray[np.uint64], cancel_flag: NDArray[np.uint8], box: Box) -> None:
    """Write the records of a box of a padded grid as whole words, none reached; the padding is never plain.

    Cancelled, it leaves out what it has not come to.
    """
    height, width = cells.shape
    first, last = max(box[0] - 1, 0), min(box[2] + 1, width)
    for y in range(box[1], box[3]):
        if cancel_flag[0] != 0:
            return
        below, above = cells[max(y - 1, 0), first:last], cells[min(y + 1, height - 1), first:last]
        _write_row(below, cells[y, first:last], above, 0 < y < height - 1, words[y, first:last])
        for x in (0, width - 1):
            words[y, x] = _UNTOUCHED | (np.uint64(cells[y, x]) << np.uint64(48))


@inner_kernel
def _write_row(
    below: NDArray[np.uint8],
    here: NDArray[np.uint8],
    above: NDArray[np.uint8],
    inside: bool,
    row: NDArray[np.uint64],
) -> None:
    """Write the records (n,) of a row but for its ends; costs (n,) of the row and of those beside it."""
    for x in range(1, len(here) - 1):  # from a number on, so that no index may be negative: it becomes vector code
        cost = here[x]
        plain = (here[x - 1] == cost) & (here[x + 1] == cost) & inside
        plain &= (below[x - 1] == cost) & (below[x] == cost) & (below[x + 1] == cost)
        plain &= (above[x - 1] == cost) & (above[x] == cost) & (above[x + 1] == cost)
        row[x] = _UNTOUCHED | (np.uint64(cost) << np.uint64(48)) | (np.uint64(plain) << np.uint64(47))


@kernel
def natural_steps(stride: int) -> NDArray[np.uint64]:
    """Offsets (8, 3): where to go on from a plain cell reached in each direction; see ``relax_bucket``.

    Straight on, and for a diagonal also along x and along y; straight directions have only the first. Unsigned, like
    the indices they are added to, so that steps back wrap around to the right sum.
    """
    steps = np.zeros((8, 3), dtype=np.uint64)
    for direction in range(8):
        x, y = DIRECTIONS[direction]
        steps[direction, 0] = np.uint64(np.int64(x + stride * y))
        if direction >= 4:
            steps[direction, 1], steps[direction, 2] = np.uint64(np.int64(x)), np.uint64(np.int64(stride * y))
    return steps
