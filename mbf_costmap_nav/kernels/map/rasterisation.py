"""Rasterisation of polygons: exactly the cells a polygon touches, each once; and discs by the middles of cells.

A cell is the half-open unit square [ix, ix + 1) x [iy, iy + 1), the same rule by which a point has its cell. A polygon
covers a cell if the closed polygon and that square share a point: so a corner that lies on the border of two cells
belongs to the upper right one, and a side along a grid line to the cells above or right of it.

A covered cell is either passed by a side, or its centre lies inside. Both parts go into one mask, so nothing can be
counted twice.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel
from mbf_costmap_nav.kernels.costs import INSCRIBED, LETHAL, UNKNOWN

FloatArray = NDArray[np.float64]


@kernel
def rasterise_polygon(corners: FloatArray, box: tuple[int, int, int, int]) -> tuple[int, int, NDArray[np.uint8]]:
    """Cells of a box that a simple polygon covers.

    Parameters
    ----------
    corners : (n, 2) float64
        Corners in cell coordinates (x, y), either sense, n >= 1. One corner is a point, two are a segment.
    box : (x0, y0, x1, y1)
        Half-open box of cells to look at.

    Returns
    -------
    x0, y0 : int
        Cell of the mask's first element.
    mask : (rows, columns) uint8
        1 where the cell (x0 + column, y0 + row) is covered.
    """
    left, low = corners[0, 0], corners[0, 1]
    right, high = left, low
    for i in range(1, len(corners)):
        left, right = min(left, corners[i, 0]), max(right, corners[i, 0])
        low, high = min(low, corners[i, 1]), max(high, corners[i, 1])
    x0, y0 = max(box[0], int(np.floor(left))), max(box[1], int(np.floor(low)))
    columns = max(0, min(box[2], int(np.floor(right)) + 1) - x0)
    rows = max(0, min(box[3], int(np.floor(high)) + 1) - y0)
    mask = np.zeros((rows, columns), dtype=np.uint8)
    parity = np.zeros((rows, columns + 1), dtype=np.uint8)
    for i in range(len(corners)):
        j = i + 1 if i + 1 < len(corners) else 0
        u0, v0, u1, v1 = corners[i, 0] - x0, corners[i, 1] - y0, corners[j, 0] - x0, corners[j, 1] - y0
        if v0 > v1:
            u0, v0, u1, v1 = u1, v1, u0, v0
        _cover_side(mask, u0, v0, u1, v1)
        # Note where the side crosses the line through the centres of a row, for the inside.
        for row in range(max(0, int(np.ceil(v0 - 0.5))), min(rows, int(np.ceil(v1 - 0.5)))):
            crossing = u0 + (u1 - u0) * (row + 0.5 - v0) / (v1 - v0)
            parity[row, min(columns, max(0, int(np.ceil(crossing - 0.5))))] ^= 1
    for row in range(rows):
        inside = 0
        for column in range(columns):
            inside ^= parity[row, column]
            mask[row, column] |= inside
    return x0, y0, mask


@inner_kernel
def _cover_side(mask: NDArray[np.uint8], u0: float, v0: float, u1: float, v1: float) -> None:
    """Mark the cells a side passes, v0 <= v1, row by row."""
    rows, columns = mask.shape
    for row in range(max(0, int(np.floor(v0))), min(rows, int(np.floor(v1)) + 1)):
        enter, leave, ends_above = u0, u1, False
        if v0 < row:
            enter = u0 + (u1 - u0) * (row - v0) / (v1 - v0)
        if v1 >= row + 1:
            leave = u0 + (u1 - u0) * (row + 1 - v0) / (v1 - v0)
            ends_above = True
        first, last = int(np.floor(min(enter, leave))), int(np.floor(max(enter, leave)))
        if ends_above and leave > enter and leave == last:
            last -= 1  # the point where it leaves belongs to the next row
        for column in range(max(0, first), min(columns - 1, last) + 1):
            mask[row, column] = 1


@kernel
def polygon_costs(cells: NDArray[np.uint8], corners: FloatArray) -> tuple[int, int, int, int, int, int]:
    """Summary of the costs under a polygon.

    Parameters
    ----------
    cells : (height, width) uint8
    corners : (n, 2) float64
        Corners in cell coordinates, n >= 1.

    Returns
    -------
    covered : int
        Number of covered cells; -1 if a corner lies out of the grid (everything else is 0 then).
    lethal, inscribed, unknown : int
        How many of them are LETHAL, INSCRIBED, UNKNOWN.
    rest : int
        Sum of all other costs.
    highest : int
        Largest cost that is not unknown.
    """
    height, width = cells.shape
    for i in range(len(corners)):
        if not (0.0 <= corners[i, 0] < width and 0.0 <= corners[i, 1] < height):
            return -1, 0, 0, 0, 0, 0
    x0, y0, mask = rasterise_polygon(corners, (0, 0, width, height))
    covered, lethal, inscribed, unknown, rest, highest = 0, 0, 0, 0, 0, 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] == 0:
                continue
            cost = int(cells[y0 + row, x0 + column])
            covered += 1
            if cost == UNKNOWN:
                unknown += 1
                continue
            highest = max(highest, cost)
            if cost == LETHAL:
                lethal += 1
            elif cost == INSCRIBED:
                inscribed += 1
            else:
                rest += cost
    return covered, lethal, inscribed, unknown, rest, highest


@kernel
def blocked_under(cells: NDArray[np.uint8], corners: FloatArray, off_grid: bool) -> tuple[int, int]:
    """How many of the cells a polygon covers are lethal, or off the grid if asked for, and how many it covers."""
    height, width = cells.shape
    x0, y0, mask = rasterise_polygon(corners, (-(1 << 40), -(1 << 40), 1 << 40, 1 << 40))
    blocked, covered = 0, 0
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] == 0:
                continue
            ix, iy = x0 + column, y0 + row
            covered += 1
            if ix < 0 or iy < 0 or ix >= width or iy >= height:
                blocked += off_grid
            elif cells[iy, ix] == LETHAL:
                blocked += 1
    return blocked, covered


@kernel
def fill_polygon(cells: NDArray[Any], corners: FloatArray, value: int) -> tuple[int, int, int, int]:
    """Write ``value`` into all covered cells on the grid; return the half-open box (x0, y0, x1, y1) around them."""
    height, width = cells.shape
    x0, y0, mask = rasterise_polygon(corners, (0, 0, width, height))
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] != 0:
                cells[y0 + row, x0 + column] = value
    return x0, y0, x0 + mask.shape[1], y0 + mask.shape[0]


@kernel
def raise_discs(cells: NDArray[np.uint8], discs: NDArray[np.float64], values: NDArray[np.uint8]) -> None:
    """Raise the cells whose middle lies in a disc to its value; unknown cells take it, too.

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
