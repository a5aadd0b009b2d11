"""The 25 short lines Theta* is made of: what each crosses, tabulated once, and paths put together from them.

When to use: lines to a parent at most ``REACH`` cells away on either axis. When not: lines of any length
(``grid_line``). An offset fits one byte, and looking along a line is a handful of look-ups without a branch.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel

REACH = 2
"""Largest offset [cells] of a cell from its parent, on either axis."""
SIDE = 2 * REACH + 1
HERE = np.uint8(REACH * SIDE + REACH)
"""Code of the offset (0, 0). An offset (dx, dy) from the parent has the code HERE + dx + SIDE * dy."""
LINE_LIMIT = 1.5
"""A credited line grows no more once it is longer than this [cells]. Paths with 3 cells are as long to 0.1 % after
pulling the string, but take 1.3 times the time."""
TOUCHED = 1e-30
"""Weight of a cell that a line only touches at a corner: too little to count, but inf if the cell is blocked."""
LONGEST_LINE = 7
"""Cells a line crosses or touches at most."""
STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
STEP_X, STEP_Y = np.array(STEPS).T.copy()


def crossed_cells(dx: int, dy: int) -> dict[tuple[int, int], float]:
    """Length [cells] of the line from the centre of cell (0, 0) to that of (dx, dy) in each cell it crosses.

    Cells of which it touches a corner between two others have the weight ``TOUCHED``.
    """
    borders_x = {(2 * i + 1) / (2 * abs(dx)) for i in range(abs(dx))}
    borders_y = {(2 * i + 1) / (2 * abs(dy)) for i in range(abs(dy))}
    along = [0.0, *sorted(borders_x | borders_y), 1.0]
    crossed: dict[tuple[int, int], float] = {}
    for begin, end in pairwise(along):
        middle = 0.5 * (begin + end)
        cell = int(np.floor(middle * dx + 0.5)), int(np.floor(middle * dy + 0.5))
        crossed[cell] = (end - begin) * float(np.hypot(dx, dy))
    for corner in borders_x & borders_y:
        x, y = int(np.floor(corner * dx)), int(np.floor(corner * dy))
        for cell in ((x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)):
            crossed.setdefault(cell, TOUCHED)
    return crossed


def _tabulate() -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32]]:
    """Tables by code: crossed cells relative to the line's end, their weights, where the line goes on from, its growth.

    Shorter lines are filled up with their end at no weight, which saves a loop of unforeseeable length. The growth is
    half of the length gained by a step, or of the step where a new line begins; it never is negative.
    """
    offsets = np.zeros((SIDE * SIDE, LONGEST_LINE, 2), dtype=np.int64)
    weights = np.zeros((SIDE * SIDE, LONGEST_LINE), dtype=np.float32)
    base = np.full(SIDE * SIDE, HERE, dtype=np.uint8)
    growth = np.zeros((SIDE * SIDE, 8), dtype=np.float32)
    for code in range(SIDE * SIDE):
        dx, dy = code % SIDE - REACH, code // SIDE - REACH
        for i, ((x, y), weight) in enumerate(crossed_cells(dx, dy).items()):
            offsets[code, i], weights[code, i] = (x - dx, y - dy), weight
        if np.hypot(dx, dy) <= LINE_LIMIT:
            base[code] = code
        else:
            dx, dy = 0, 0
        gained = [np.hypot(dx + x, dy + y) - np.hypot(dx, dy) for x, y in STEPS]
        growth[code] = 0.5 * np.maximum(gained, 0.0)
    return offsets, weights, base, growth


CROSSED, WEIGHTS, BASE, GROWTH = _tabulate()


@kernel
def trace_lines(origin: NDArray[np.uint8], stride: int, start: int, end: int) -> NDArray[np.int32]:
    """Cells (m,) from ``start`` to the settled cell ``end``, each in sight of the one before it."""
    path = np.empty(1024, dtype=np.int32)
    path[0], length, cell = end, 1, end
    while cell != start:
        code = int(origin[cell])
        cell -= code % SIDE - REACH + stride * (code // SIDE - REACH)
        if length == path.size:
            path = np.concatenate((path, np.empty_like(path)))
        path[length] = cell
        length += 1
    return path[:length][::-1].copy()
