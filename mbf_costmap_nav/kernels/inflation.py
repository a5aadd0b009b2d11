"""Exact Euclidean inflation in two separable passes.

The squared distance to the nearest seed is min over dx of dx^2 + g(x + dx)^2, where g is the distance along the column
(Meijster, Roerdink and Hesselink 2000, first phase). Only distances up to the inflation radius matter, so the second
phase tries every dx of the radius on whole rows instead of building envelopes: one-dimensional loops over narrow
integers, which the compiler turns into vector code. The cost grows linearly with the radius.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel

Row = NDArray[Any]
"""One row of narrow unsigned integers; the width depends on the radius."""

LARGEST_NARROW_RADIUS = 180
"""Up to this radius [cells] the sum of two squares fits 16 bits."""


def inflate(
    cells: NDArray[np.uint8],
    seeds: NDArray[np.uint8],
    box: tuple[int, int, int, int],
    cost_of_square: NDArray[np.uint8],
    radius: int,
    unknown_from: int,
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
        Largest distance [cells] with a cost.
    unknown_from : int
        Smallest cost that replaces an unknown cell.
    """
    narrow = radius <= LARGEST_NARROW_RADIUS
    column_dtype, square_dtype = (np.uint8, np.uint16) if narrow else (np.uint16, np.uint32)
    height, width = cells.shape
    x0, y0, x1, y1 = box
    left, right = max(0, x0 - radius), min(width, x1 + radius)
    bottom, top = max(0, y0 - radius), min(height, y1 + radius)
    columns = np.empty((top - bottom, right - left), dtype=column_dtype)
    squares = np.empty(right - left, dtype=square_dtype)
    nearest = np.empty(x1 - x0, dtype=square_dtype)
    _column_distances(seeds[bottom:top, left:right], columns, column_dtype(radius + 1))
    _spread_rows(
        cells[y0:y1, x0:x1], columns[y0 - bottom : y1 - bottom], x0 - left, squares, nearest, cost_of_square, radius,
        unknown_from,
    )  # fmt: skip


@kernel
def _mark_row(seeds: NDArray[np.uint8], row: Row, cap: np.unsignedinteger[Any]) -> None:
    """Distance 0 at seeds, ``cap`` elsewhere."""
    for x in range(row.size):
        row[x] = row.dtype.type(0) if seeds[x] != 0 else cap


@kernel
def _grow_row(previous: Row, row: Row, cap: np.unsignedinteger[Any]) -> None:
    """Set row = min(row, previous + 1), at most ``cap``: one step of a sweep along the columns."""
    for x in range(row.size):
        row[x] = min(row[x], min(row.dtype.type(previous[x] + row.dtype.type(1)), cap))


@kernel
def _column_distances(seeds: NDArray[np.uint8], columns: Row, cap: np.unsignedinteger[Any]) -> None:
    """Distance of each cell to the nearest seed of its column, capped."""
    rows = columns.shape[0]
    for y in range(rows):
        _mark_row(seeds[y], columns[y], cap)
        if y > 0:
            _grow_row(columns[y - 1], columns[y], cap)
    for y in range(rows - 2, -1, -1):
        _grow_row(columns[y + 1], columns[y], cap)


@kernel
def _square_row(row: Row, squares: Row) -> Any:
    """Set squares = row^2; return the smallest."""
    smallest = squares.dtype.type(0) - squares.dtype.type(1)
    least = squares.dtype.type(smallest)
    for x in range(row.size):
        value = squares.dtype.type(row[x])
        square = squares.dtype.type(value * value)
        squares[x] = square
        least = min(least, square)
    return least


@kernel
def _lower_row(nearest: Row, squares: Row, offset: np.unsignedinteger[Any]) -> None:
    """Set nearest = min(nearest, squares + offset)."""
    for x in range(nearest.size):
        nearest[x] = min(nearest[x], nearest.dtype.type(squares[x] + offset))


@kernel
def _write_row(cells: Row, nearest: Row, cost_of_square: Row, unknown_from: int) -> None:
    """Raise a row of cells to the cost of its squared distances; unknown cells only from ``unknown_from`` on."""
    for x in range(cells.size):
        square = nearest[x]
        if square < cost_of_square.size:
            cost = cost_of_square[square]
            old = cells[x]
            if (old == 255 and cost >= unknown_from) or cost > old:
                cells[x] = cost


@kernel
def _spread_rows(
    cells: Row,
    columns: Row,
    margin: int,
    squares: Row,
    nearest: Row,
    cost_of_square: Row,
    radius: int,
    unknown_from: int,
) -> None:
    """Second pass: combine the column distances of every row and write the costs.

    ``columns`` holds ``margin`` more cells on the left than ``cells`` and possibly more on the right.
    """
    height, width = cells.shape
    for y in range(height):
        if _square_row(columns[y], squares) >= cost_of_square.size:
            continue  # no seed within the radius of this row
        nearest[:] = squares[margin : margin + width]
        for dx in range(1, radius + 1):
            offset = squares.dtype.type(dx * dx)
            first = max(0, dx - margin)  # the left neighbour of earlier cells lies outside the array
            _lower_row(nearest[first:], squares[first + margin - dx : width + margin - dx], offset)
            last = min(width, squares.size - margin - dx)
            if last > 0:
                _lower_row(nearest[:last], squares[margin + dx : margin + dx + last], offset)
        _write_row(cells[y], nearest, cost_of_square, unknown_from)
