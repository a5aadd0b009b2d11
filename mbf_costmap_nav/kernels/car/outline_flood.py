"""Where an outline gets to if it could move sideways and turn on the spot: a flood over cells and headings.

When to use: by ``planning.outline_reach``, to prove that no car of this outline gets from a place to another. When not:
to find a path.

The 128 headings of a cell are the bits of two words, so a cell takes all of its neighbour's at once. A bin, a cell
and a heading, is closed only if the outline touches an obstacle wherever in the bin it stands: the centre of a lethal
cell is deep enough in the outline for every position in the cell and every heading of the bin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, kernel, plain_kernel

FloatArray = NDArray[np.float64]

WORDS, BITS = 2, 64
"""Words of a cell, and bits of a word."""
HEADINGS = WORDS * BITS
DEPTH = 0.25
"""So deep [cells] in the outline the centre of a lethal cell is found by the samples that a search looks at."""


@plain_kernel
def _is_deep_inside(corners: FloatArray, x: float, y: float) -> bool:
    """Whether a point [cells] lies in a polygon (n, 2), ``DEPTH`` from its sides."""
    inside, before = False, corners.shape[0] - 1
    for i in range(corners.shape[0]):
        ax, ay, bx, by = corners[before, 0], corners[before, 1], corners[i, 0], corners[i, 1]
        dx, dy = bx - ax, by - ay
        length_squared = max(dx * dx + dy * dy, 1e-12)
        along = min(max(((x - ax) * dx + (y - ay) * dy) / length_squared, 0.0), 1.0)
        off_x, off_y = x - ax - along * dx, y - ay - along * dy
        if off_x * off_x + off_y * off_y < DEPTH * DEPTH:
            return False
        if (ay > y) != (by > y) and x < ax + dx * (y - ay) / dy:
            inside = not inside
        before = i
    return inside


@plain_kernel
def _is_always_covered(corners: FloatArray, heading: int, dx: int, dy: int) -> bool:
    """Whether an outline (n, 2) [cells] covers the cell so many away from its own, wherever in its bin it stands."""
    for side in (-0.5, 0.5):
        angle = (heading + side) * 2.0 * np.pi / HEADINGS
        c, s = np.cos(angle), np.sin(angle)
        for x in (dx - 0.5, dx + 0.5):
            for y in (dy - 0.5, dy + 0.5):
                if not _is_deep_inside(corners, c * x + s * y, c * y - s * x):
                    return False
    return True


@kernel
def covered_runs(corners: FloatArray, reach: int) -> NDArray[np.int64]:
    """Runs (n, 4: heading, row, first, last column, from its own cell) of cells that an outline always covers.

    ``corners`` (m, 2) [cells] are given from the point that moves over the cells, at most ``reach`` away.
    """
    runs = np.empty((HEADINGS * (2 * reach + 1) * (reach + 1), 4), dtype=np.int64)
    count = Count(0)
    for heading in range(HEADINGS):
        for dy in range(-reach, reach + 1):
            is_open = False
            for dx in range(-reach, reach + 1):
                covered = _is_always_covered(corners, heading, dx, dy)
                if covered and not is_open:
                    runs[count, 0], runs[count, 1], runs[count, 2] = heading, dy, dx
                    count += 1
                if covered:
                    runs[count - 1, 3] = dx
                is_open = covered
    return runs[:count].copy()


@kernel
def open_headings(lethal: NDArray[np.bool_], runs: NDArray[np.int64], reach: int) -> NDArray[np.uint64]:
    """(height, width, WORDS) Words whose bits are the headings at which a cell is open; off the map all is lethal."""
    height, width = lethal.shape
    counts = np.empty(
        (height + 2 * reach, width + 2 * reach + 1), dtype=np.uint16
    )  # it may overflow: differences count
    for row in range(counts.shape[0]):
        counts[row, 0] = 0
        iy = row - reach
        for column in range(width + 2 * reach):
            ix = column - reach
            off_map = iy < 0 or iy >= height or ix < 0 or ix >= width
            counts[row, column + 1] = counts[row, column] + np.uint16(1 if off_map else lethal[iy, ix])
    words = np.zeros((height, width, WORDS), dtype=np.uint64)
    closed = np.empty(width, dtype=np.bool_)
    for iy in range(height):
        run = Count(0)
        for heading in range(HEADINGS):
            closed[:] = False
            while run < runs.shape[0] and runs[run, 0] == heading:
                row = counts[iy + reach + runs[run, 1]]
                behind, ahead = row[reach + runs[run, 2] :], row[reach + runs[run, 3] + 1 :]
                for ix in range(width):
                    closed[ix] |= ahead[ix] != behind[ix]
                run += 1
            for ix in range(width):
                words[iy, ix, heading // BITS] |= np.uint64(not closed[ix]) << np.uint64(heading % BITS)
    return words


@plain_kernel
def _turned(bits: NDArray[np.uint64], word: int) -> np.uint64:
    """A word of a cell (WORDS,) with the bits next to those that are set, all round."""
    one, last = np.uint64(1), np.uint64(BITS - 1)
    here, before, behind = bits[word], bits[(word + WORDS - 1) % WORDS], bits[(word + 1) % WORDS]
    turned: np.uint64 = here | (here << one) | (before >> last) | (here >> one) | (behind << last)
    return turned


@kernel
def flood(words: NDArray[np.uint64], ix: int, iy: int, heading: int) -> NDArray[np.uint64]:
    """(height, width, WORDS) What is reached from a bin; steps lead to the eight cells around and turn by a heading."""
    height, width, _ = words.shape
    reached, waits = np.zeros_like(words), np.zeros((height, width), dtype=np.bool_)
    queue = np.empty(height * width, dtype=np.int64)  # a ring: each cell waits once at most
    spread = np.empty(WORDS, dtype=np.uint64)
    reached[iy, ix, heading // BITS] = np.uint64(1) << np.uint64(heading % BITS)
    queue[0], waits[iy, ix] = iy * width + ix, True
    first, count = Count(0), Count(1)
    while count > 0:
        y, x = queue[first] // width, queue[first] % width
        first, count = (first + 1) % queue.size, count - 1
        waits[y, x] = False
        for word in range(WORDS):
            spread[word] = _turned(reached[y, x], word)
        for row in range(max(y - 1, 0), min(y + 2, height)):
            for column in range(max(x - 1, 0), min(x + 2, width)):
                if _is_new(words[row, column], spread, reached[row, column]) and not waits[row, column]:
                    waits[row, column] = True
                    queue[(first + count) % queue.size] = row * width + column
                    count += 1
    return reached


@plain_kernel
def _is_new(words: NDArray[np.uint64], spread: NDArray[np.uint64], reached: NDArray[np.uint64]) -> bool:
    """Whether a cell is reached at further headings; they are added."""
    is_new = False
    for word in range(WORDS):
        gain = spread[word] & words[word] & ~reached[word]
        if gain != np.uint64(0):
            reached[word] |= gain
            is_new = True
    return is_new
