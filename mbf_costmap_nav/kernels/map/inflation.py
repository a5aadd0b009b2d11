"""Exact Euclidean inflation in two separable passes.

The squared distance to the nearest seed is the smallest dx^2 + g(x + dx)^2, where g is the distance along the column
(first phase of Meijster, Roerdink and Hesselink 2000). Only distances up to the inflation radius matter, so the second
phase tries every dx of the radius on whole rows instead of building envelopes. Its cost grows with the radius.

All of it runs on narrow unsigned integers, one row at a time, so that the compiler turns the loops into vector code.
For the same reason squared distances are stored upside down, as closeness = 65535 - distance^2: the sum then is a
saturating subtraction, which is one instruction, and "too far" is 0. Loop counters are unsigned because numba checks
signed ones for negative indices. (8-bit squares for small radii gained a fifth and doubled the compile time.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel, plain_kernel
from mbf_costmap_nav.kernels.costs import UNKNOWN

LARGEST_RADIUS = 253
"""[cells] Column distances up to one more than the radius have to fit 8 bits, their squares 16."""
TOP = 65535
"""Closeness of a seed."""

Cells = NDArray[np.uint8]
Closeness = NDArray[np.uint16]


def inflate(
    cells: Cells, seeds: Cells, box: tuple[int, int, int, int], cost_of_square: Cells, radius: int, unknown_from: int
) -> None:
    """Raise the cells of a box to the cost of their distance to the nearest seed.

    Parameters
    ----------
    cells : (height, width) uint8
        Costs, changed inside the box.
    seeds : (height, width) uint8
        Non-zero where costs spread from; read up to ``radius`` cells beyond the box.
    box : (x0, y0, x1, y1)
        Half-open, on the grid.
    cost_of_square : (radius^2 + 1,) uint8
        Cost by squared distance [cells^2].
    radius : int
        Largest distance [cells] with a cost, at most ``LARGEST_RADIUS``.
    unknown_from : int
        Smallest cost that replaces an unknown cell.
    """
    cost_of_closeness = np.zeros(TOP + 1, dtype=np.uint8)
    cost_of_closeness[TOP - radius * radius :] = cost_of_square[::-1]
    height, width = cells.shape
    x0, y0, x1, y1 = box
    left, right = max(0, x0 - radius), min(width, x1 + radius)
    bottom, top = max(0, y0 - radius), min(height, y1 + radius)
    columns = np.empty((top - bottom, right - left), dtype=np.uint8)
    _column_distances(seeds, left, bottom, columns, np.uint8(radius + 1))
    _spread_rows(cells, (x0, y0, x1, y1), columns, left, bottom, radius, cost_of_closeness, np.uint8(unknown_from))


@plain_kernel
def _column_distances(seeds: Cells, left: int, bottom: int, columns: Cells, cap: np.uint8) -> None:
    """Distance of each cell to the nearest seed of its column, at most ``cap``: one sweep up, one down.

    The first of ``columns`` belongs to the cell (left, bottom) of ``seeds``.
    """
    rows, width = columns.shape
    for y in range(rows):
        _mark_row(seeds[bottom + y, left : left + width], columns[y], cap)
        if y > 0:
            _sweep_row(columns[y - 1], columns[y], cap)
    for y in range(rows - 2, -1, -1):
        _sweep_row(columns[y + 1], columns[y], cap)


@inner_kernel
def _mark_row(seeds: Cells, row: Cells, cap: np.uint8) -> None:
    """Distance 0 at seeds, ``cap`` elsewhere."""
    for x in range(row.size):
        row[x] = np.uint8(0) if seeds[x] != 0 else cap


@inner_kernel
def _sweep_row(previous: Cells, row: Cells, cap: np.uint8) -> None:
    """Set row = min(row, previous + 1), at most ``cap``."""
    for x in range(row.size):
        row[x] = min(row[x], min(np.uint8(previous[x] + np.uint8(1)), cap))


@kernel
def _spread_rows(
    cells: Cells,
    box: tuple[int, int, int, int],
    columns: Cells,
    left: int,
    bottom: int,
    radius: int,
    cost_of_closeness: Cells,
    unknown_from: np.uint8,
) -> None:
    """Second pass: combine the column distances along every row of the box and write the costs.

    The first of ``columns`` belongs to the cell (left, bottom).
    """
    x0, y0, x1, y1 = box
    # One row and ``radius`` entries more on each side; those out of the grid stay 0, too far.
    closeness = np.zeros(x1 - x0 + 2 * radius, dtype=np.uint16)
    first = np.uint64(radius - (x0 - left))
    nearest = np.empty(x1 - x0, dtype=np.uint16)
    costs = np.empty(x1 - x0, dtype=np.uint8)
    for y in range(y0, y1):
        closest = _closeness_row(columns[y - bottom], closeness, first)
        if TOP - closest > radius * radius:
            continue  # no seed within the radius of this row
        for x in range(np.uint64(nearest.size)):  # a slice is longer to compile, see ``compiled``
            nearest[x] = closeness[x + np.uint64(radius)]
        for dx in range(1, radius + 1):
            _raise_row(nearest, closeness, np.uint64(radius - dx), np.uint64(radius + dx), np.uint16(dx * dx))
        _look_up(nearest, cost_of_closeness, costs)
        _raise_costs(cells[y, x0:x1], costs, unknown_from)


@inner_kernel
def _closeness_row(row: Cells, closeness: Closeness, first: np.uint64) -> np.uint16:
    """Fill closeness = TOP - row^2 from ``first`` on; return the largest."""
    closest = np.uint16(0)
    for x in range(np.uint64(row.size)):
        distance = np.uint16(row[x])
        close = np.uint16(np.uint16(TOP) - np.uint16(distance * distance))
        closeness[x + first] = close
        closest = max(closest, close)
    return closest


@inner_kernel
def _raise_row(nearest: Closeness, closeness: Closeness, left: np.uint64, right: np.uint64, offset: np.uint16) -> None:
    """Set nearest = max(nearest, closeness of the neighbours dx cells to the left and right - dx^2)."""
    for x in range(np.uint64(nearest.size)):
        close = max(closeness[x + left], closeness[x + right])
        close = np.uint16(close - offset) if close > offset else np.uint16(0)
        nearest[x] = max(nearest[x], close)


@inner_kernel
def _look_up(nearest: Closeness, cost_of_closeness: Cells, costs: Cells) -> None:
    """Costs of a row; a loop of its own, as table look-ups do not vectorise and the rest does."""
    for x in range(np.uint64(nearest.size)):
        costs[x] = cost_of_closeness[nearest[x]]


@inner_kernel
def _raise_costs(row: Cells, costs: Cells, unknown_from: np.uint8) -> None:
    """Raise cells to the costs; unknown, the largest byte, is replaced by costs from ``unknown_from`` on."""
    for x in range(np.uint64(row.size)):
        old, cost = row[x], costs[x]
        row[x] = cost if old == UNKNOWN and cost >= unknown_from else max(old, cost)
