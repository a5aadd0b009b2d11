"""Discs in a grid of costs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel

UNKNOWN = 255


@kernel
def raise_discs(cells: NDArray[np.uint8], discs: NDArray[np.float64], values: NDArray[np.uint8]) -> None:
    """Raise the cells whose middle lies in a disc to its value; unknown cells (255) take it, too.

    Parameters
    ----------
    cells : (height, width) uint8
    discs : (n, 3) float64
        Middle (x, y) and radius in cells; the middle of cell [0, 0] is (0.5, 0.5).
    values : (n,) uint8
    """
    height, width = cells.shape
    for i in range(len(discs)):
        x, y, radius = discs[i, 0], discs[i, 1], discs[i, 2]
        first_row, last_row = max(0, math.floor(y - radius)), min(height - 1, math.floor(y + radius))
        first_column, last_column = max(0, math.floor(x - radius)), min(width - 1, math.floor(x + radius))
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                dx, dy = column + 0.5 - x, row + 0.5 - y
                if dx * dx + dy * dy > radius * radius:
                    continue
                if cells[row, column] < values[i] or cells[row, column] == UNKNOWN:
                    cells[row, column] = values[i]
