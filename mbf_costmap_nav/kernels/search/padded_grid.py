"""The grid that the searches share: costs framed by one blocked cell on every side, so that no loop tests for a border.

Entering or leaving a cell costs half its *traversal* ``table[cost]`` per cell of length, so a step between cells a
and b of length L weighs ``L * (table[a] + table[b]) / 2``: symmetric, and infinite where one of them is blocked.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel

SQRT2 = np.float32(np.sqrt(2.0))
INF = np.float32(np.inf)
CELLS_PER_POLL = 1 << 20
"""How many cells are copied between two looks at the cancel flag; at most a millisecond."""
NEVER_CANCELED = np.zeros(1, dtype=np.uint8)

Integer = int | np.integer[Any]


class PaddedGrid(NamedTuple):
    """Costs and what they weigh. A cell has one flat index, row by row.

    Attributes
    ----------
    cells : (n,) uint8
        Costs, see ``pad_cells``.
    stride : int
        Row length, padding included.
    table : (256,) float32
        Traversal of each cost, at least 1; inf = blocked.
    """

    cells: NDArray[np.uint8]
    stride: int
    table: NDArray[np.float32]


def pad_cells(
    cells: NDArray[np.uint8], border: int, cancel_flag: NDArray[np.uint8] = NEVER_CANCELED
) -> NDArray[np.uint8]:
    """Copy (height, width) cells into a flat ((height + 2) * (width + 2),) array framed by ``border``.

    With the flag set it ends early, and what is not copied yet holds anything; a search then starts nowhere.
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


@inner_kernel
def octile_distance(dx: Integer, dy: Integer) -> np.float32:
    """Length of the shortest 8-connected path over ``dx``, ``dy`` >= 0 free cells."""
    if dx < dy:
        dx, dy = dy, dx
    return np.float32(dx) + (SQRT2 - np.float32(1.0)) * np.float32(dy)
