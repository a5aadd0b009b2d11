"""Neighbours, slopes and heights of surface patches; what stands on them.

A patch belongs to a cell of the plan view. ``links[p, d]`` is the patch that continues patch ``p`` in direction ``d``
(east, north-east, north, ... south-east), -1 where the surface ends. Links are mutual.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.building.columns import LOWEST
from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel

STEP_X = np.array([1, 1, 0, -1, -1, -1, 0, 1])
STEP_Y = np.array([0, 1, 1, 1, 0, -1, -1, -1])
DIRECTIONS = 8


@kernel
def link_patches(cells: IntArray, heights: FloatArray, offsets: IntArray, columns: int, rise: float) -> IntArray:
    """Link each patch to the nearest in height of each neighbouring cell, if both choose each other.

    Parameters
    ----------
    cells, heights : (P,)
        Sorted by cell.
    offsets : (cells + 1,) int32
        First patch of each cell.
    rise : float
        Greatest difference of the heights of linked patches [m]; sqrt(2) times that between diagonal neighbours.

    Returns
    -------
    links : (P, 8) int32
    """
    rows = (offsets.shape[0] - 1) // columns
    chosen = np.empty((cells.shape[0], DIRECTIONS), dtype=np.int32)
    for patch in range(cells.shape[0]):
        row, column = cells[patch] // columns, cells[patch] % columns
        for direction in range(DIRECTIONS):
            chosen[patch, direction] = -1
            y, x = row + STEP_Y[direction], column + STEP_X[direction]
            if y < 0 or y >= rows or x < 0 or x >= columns:
                continue
            nearest = rise if direction % 2 == 0 else 1.4142135623730951 * rise
            place = y * columns + x
            for other in range(offsets[place], offsets[place + 1]):
                distance = abs(heights[other] - heights[patch])
                if distance <= nearest:
                    nearest = distance
                    chosen[patch, direction] = other
    links = np.empty((cells.shape[0], DIRECTIONS), dtype=np.int32)
    for patch in range(cells.shape[0]):
        for direction in range(DIRECTIONS):
            other = chosen[patch, direction]
            is_mutual = other >= 0 and chosen[other, (direction + 4) % DIRECTIONS] == patch
            links[patch, direction] = other if is_mutual else -1
    return links


@inner_kernel
def slope_of(patch: int, heights: FloatArray, links: IntArray, cell: float) -> tuple[float, float]:
    """Gradient of the plane through a patch that fits its linked neighbours best (least squares)."""
    xx = xy = yy = xz = yz = 0.0
    for direction in range(DIRECTIONS):
        other = links[patch, direction]
        if other < 0:
            continue
        x, y, z = cell * STEP_X[direction], cell * STEP_Y[direction], heights[other] - heights[patch]
        xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
        xz, yz = xz + x * z, yz + y * z
    determinant = xx * yy - xy * xy
    if determinant > 1e-9 * (xx + yy) * (xx + yy):
        return (yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant
    return xz / xx if xx > 0.0 else 0.0, yz / yy if yy > 0.0 else 0.0


@kernel
def slopes_of_patches(heights: FloatArray, links: IntArray, cell: float) -> FloatArray:
    """Gradients (P, 2) of all patches."""
    slopes = np.empty((heights.shape[0], 2), dtype=np.float64)
    for patch in range(heights.shape[0]):
        slopes[patch, 0], slopes[patch, 1] = slope_of(patch, heights, links, cell)
    return slopes


@kernel
def settle_patches(
    points: FloatArray,
    firsts: NDArray[np.int64],
    ends: NDArray[np.int64],
    kinds: IntArray,
    centres: FloatArray,
    heights: FloatArray,
    slopes: FloatArray,
    links: IntArray,
    limits: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """Heights (P,) at the cells' centres along known slopes, and how many points stand on each patch (P,).

    Of the lowest patch of a column the points count that lie within a band above its lowest one; a single point below
    all others does not count, it is an error of the sensor. Of the others the same is done from the top, where a single
    point counts that is as high as a linked neighbour: that of a slab of which mostly the underside was seen.

    Parameters
    ----------
    centres : (P, 2) float64
        Of the patches' cells [m].
    limits : (3,) float64
        Thickness of the band, and the heights between which points are an obstacle [m].
    """
    band, step, clearance = limits[0], limits[1], limits[2]
    settled = heights.copy()
    standing = np.zeros(heights.shape[0], dtype=np.int32)
    for patch in range(heights.shape[0]):
        count = ends[patch] - firsts[patch]
        if count == 0:
            continue
        up = 1.0 if kinds[patch] == LOWEST else -1.0
        lowest = second = np.inf
        outermost = firsts[patch]
        for position in range(firsts[patch], ends[patch]):
            above = up * _above(points, position, centres, patch, heights, slopes)
            if above < lowest:
                lowest, second, outermost = above, lowest, position
            elif above < second:
                second = above
        is_alone = count > 2 and second - lowest > band
        if is_alone and kinds[patch] != LOWEST:
            is_alone = not _is_beside(points, outermost, links, centres, patch, heights, slopes, band)
        floor = second if is_alone else lowest
        total, used = 0.0, 0
        for position in range(firsts[patch], ends[patch]):
            above = up * _above(points, position, centres, patch, heights, slopes)
            if floor <= above <= floor + band:
                total += above
                used += 1
        mean = total / used
        settled[patch] = heights[patch] + up * mean
        for position in range(firsts[patch], ends[patch]):
            above = up * (up * _above(points, position, centres, patch, heights, slopes) - mean)
            standing[patch] += step < above < clearance
    return settled, standing


@inner_kernel
def _is_beside(
    points: FloatArray,
    position: int,
    links: IntArray,
    centres: FloatArray,
    patch: int,
    heights: FloatArray,
    slopes: FloatArray,
    band: float,
) -> bool:
    """Whether a point is within ``band`` [m] of the plane of a linked neighbour."""
    for direction in range(DIRECTIONS):
        other = links[patch, direction]
        if other >= 0 and abs(_above(points, position, centres, other, heights, slopes)) <= band:
            return True
    return False


@inner_kernel
def _above(
    points: FloatArray, position: int, centres: FloatArray, patch: int, heights: FloatArray, slopes: FloatArray
) -> float:
    """Height of a point above the plane of a patch [m]."""
    x, y = points[position, 0] - centres[patch, 0], points[position, 1] - centres[patch, 1]
    height: float = points[position, 2] - heights[patch] - slopes[patch, 0] * x - slopes[patch, 1] * y
    return height
