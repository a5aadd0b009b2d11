"""Points sorted into the square cells of a plan view, and into surface patches: runs of points without a wide gap.

After Triebel, Pfaff and Burgard, "Multi-level surface maps for outdoor terrain mapping and loop closing" (IROS 2006):
a cell holds one patch for each surface above it, so bridges and storeys need no case of their own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel

LOWEST, SLAB, TOP = 0, 1, 2
"""Kinds of patches: the ground of a column, a thin run of points above it, and the upper end of a thick run."""


@kernel
def sort_into_cells(
    points: FloatArray, by_height: NDArray[np.int64], corner: FloatArray, cell: float, columns: int, rows: int
) -> tuple[NDArray[np.int64], FloatArray]:
    """Sort points (n, 3) by cell, from the bottom to the top within each, points of one height by x and y.

    Parameters
    ----------
    by_height : (n,) int64
        Order of the points by z.
    corner : (2,) float64
        x and y of the lower left corner of the grid [m].

    Returns
    -------
    offsets : (rows * columns + 1,) int64
        First point of each cell, row by row.
    points : (n, 3) float64
    """
    count = points.shape[0]
    cells = np.empty(count, dtype=np.int64)
    offsets = np.zeros(rows * columns + 1, dtype=np.int64)
    for index in range(count):
        column = min(max(int((points[index, 0] - corner[0]) / cell), 0), columns - 1)
        row = min(max(int((points[index, 1] - corner[1]) / cell), 0), rows - 1)
        cells[index] = row * columns + column
        offsets[cells[index] + 1] += 1
    for place in range(rows * columns):
        offsets[place + 1] += offsets[place]
    cursor = offsets[:-1].copy()
    ordered = np.empty((count, 3), dtype=np.float64)
    for position in range(count):
        index = by_height[position]
        place = cursor[cells[index]]
        cursor[cells[index]] += 1
        for axis in range(3):
            ordered[place, axis] = points[index, axis]
    for place in range(rows * columns):
        for position in range(offsets[place] + 1, offsets[place + 1]):
            # Points of one height by x and y, so that sums do not depend on the order of the files.
            lower = position
            while lower > offsets[place] and _comes_before(ordered, lower, lower - 1):
                for axis in range(3):
                    swapped = ordered[lower, axis]
                    ordered[lower, axis] = ordered[lower - 1, axis]
                    ordered[lower - 1, axis] = swapped
                lower -= 1
    return offsets, ordered


@inner_kernel
def _comes_before(points: FloatArray, one: int, other: int) -> bool:
    if points[one, 2] != points[other, 2]:
        return False
    if points[one, 0] != points[other, 0]:
        return bool(points[one, 0] < points[other, 0])
    return bool(points[one, 1] < points[other, 1])


@kernel
def split_columns(
    points: FloatArray, offsets: NDArray[np.int64], gap: float, thickest: float
) -> tuple[IntArray, NDArray[np.int64], NDArray[np.int64], IntArray]:
    """Split the column of points above each cell where two of them are more than ``gap`` [m] apart.

    A run of points thicker than ``thickest`` [m] is a wall, a trunk or a crown. One that begins at the ground gives two
    patches: the ground below it, and its upper end, which may carry a bridge.

    Returns
    -------
    cell, first, end, kind
        Of each patch (P,): its points are ``first`` to ``end - 1``.
    """
    most = 2 * points.shape[0]
    cells = np.empty(most, dtype=np.int32)
    firsts = np.empty(most, dtype=np.int64)
    ends = np.empty(most, dtype=np.int64)
    kinds = np.empty(most, dtype=np.int32)
    count = 0
    for cell in range(offsets.shape[0] - 1):
        first, last = offsets[cell], offsets[cell + 1] - 1
        for position in range(offsets[cell], offsets[cell + 1]):
            if position < last and points[position + 1, 2] - points[position, 2] <= gap:
                continue
            is_thick = points[position, 2] - points[first, 2] > thickest
            for kind in (LOWEST, SLAB, TOP):
                is_ground = first == offsets[cell]
                if (
                    (kind == LOWEST and is_ground)
                    or (kind == TOP and is_thick)
                    or (kind == SLAB and not is_ground and not is_thick)
                ):
                    cells[count], firsts[count], ends[count], kinds[count] = cell, first, position + 1, kind
                    count += 1
            first = position + 1
    return cells[:count].copy(), firsts[:count].copy(), ends[:count].copy(), kinds[:count].copy()


@kernel
def first_heights(
    points: FloatArray, firsts: NDArray[np.int64], ends: NDArray[np.int64], kinds: IntArray, bands: FloatArray
) -> FloatArray:
    """Heights (P,) of patches before their slope is known: mean of a band above the bottom, or below the top.

    The lowest patch of a column is the ground, below whatever grows or stands on it. Of another one the upper
    side is driven on.

    Parameters
    ----------
    bands : (2,) float64
        Thickness of the band of the lowest patches, and of others, whose underside may have been seen, too [m].
    """
    heights = np.empty(firsts.shape[0], dtype=np.float64)
    for patch in range(firsts.shape[0]):
        bottom, top = points[firsts[patch], 2], points[ends[patch] - 1, 2]
        total, used = 0.0, 0
        for position in range(firsts[patch], ends[patch]):
            height = points[position, 2]
            if (height <= bottom + bands[0]) if kinds[patch] == LOWEST else (height >= top - bands[1]):
                total += height
                used += 1
        heights[patch] = total / used
    return heights
