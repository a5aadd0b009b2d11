"""Faces between linked surface patches, how far points lie from them, and heights that fit the points better."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel

EAST, NORTH, WEST, SOUTH = 0, 2, 4, 6


@inner_kernel
def quad_at(patch: int, along_x: int, along_y: int, links: IntArray, is_used: BoolArray) -> tuple[int, int, int]:
    """The other corners of the quad in the directions of two axes: along x, across, along y; -1 if it is no face.

    Both paths to the corner across have to lead to the same patch, else the surface is torn there.
    """
    first, last = links[patch, along_x], links[patch, along_y]
    if first < 0 or last < 0 or not (is_used[patch] and is_used[first] and is_used[last]):
        return -1, -1, -1
    across = links[first, along_y]
    if across < 0 or across != links[last, along_x] or not is_used[across]:
        return -1, -1, -1
    return first, across, last


@inner_kernel
def splits_at(start: int, first: int, across: int, last: int, heights: FloatArray) -> bool:
    """Whether a quad is split from its start to the corner across: along the diagonal with the smaller rise."""
    return bool(abs(heights[across] - heights[start]) < abs(heights[last] - heights[first]))


@kernel
def faces_of_patches(heights: FloatArray, links: IntArray, is_used: BoolArray) -> IntArray:
    """Triangles (F, 3) between the used ones of the patches (P,), counter-clockwise seen from above."""
    faces = np.empty((2 * heights.shape[0], 3), dtype=np.int32)
    count = 0
    for patch in range(heights.shape[0]):
        first, across, last = quad_at(patch, EAST, NORTH, links, is_used)
        if first < 0:
            continue
        if splits_at(patch, first, across, last, heights):
            faces[count, 0], faces[count, 1], faces[count, 2] = patch, first, across
            faces[count + 1, 0], faces[count + 1, 1], faces[count + 1, 2] = patch, across, last
        else:
            faces[count, 0], faces[count, 1], faces[count, 2] = patch, first, last
            faces[count + 1, 0], faces[count + 1, 1], faces[count + 1, 2] = first, across, last
        count += 2
    return faces[:count].copy()


@kernel
def distances_to_faces(
    points: FloatArray,
    firsts: NDArray[np.int64],
    ends: NDArray[np.int64],
    centres: FloatArray,
    heights: FloatArray,
    links: IntArray,
    is_used: BoolArray,
    cell: float,
    within: float,
) -> NDArray[np.float32]:
    """Vertical distances (n,) float32 of points to the faces [m], NaN for points that belong to none.

    A point belongs to the surface if it lies at most ``within`` [m] above or below it.
    """
    distances = np.full(points.shape[0], np.nan, dtype=np.float32)
    for patch in range(heights.shape[0]):
        if not is_used[patch]:
            continue
        for position in range(firsts[patch], ends[patch]):
            x = (points[position, 0] - centres[patch, 0]) / cell
            y = (points[position, 1] - centres[patch, 1]) / cell
            first, across, last = quad_at(
                patch, EAST if x >= 0.0 else WEST, NORTH if y >= 0.0 else SOUTH, links, is_used
            )
            if first >= 0:
                a, b, c, d = weights_in_quad(abs(x), abs(y), splits_at(patch, first, across, last, heights))
                height = a * heights[patch] + b * heights[first] + c * heights[across] + d * heights[last]
                distance = points[position, 2] - height
                if abs(distance) <= within:
                    distances[position] = distance
    return distances


@inner_kernel
def weights_in_quad(x: float, y: float, is_split_from_start: bool) -> tuple[float, float, float, float]:
    """Weights of the four corners in the height of the faces of a quad, at (x, y) in 0..1 from its start.

    The corners are the start, the one along x, the one across, and the one along y.
    """
    if is_split_from_start:
        return (1.0 - x, x - y, y, 0.0) if x >= y else (1.0 - y, 0.0, x, y - x)
    return (1.0 - x - y, x, 0.0, y) if x + y <= 1.0 else (0.0, 1.0 - y, x + y - 1.0, 1.0 - x)


@kernel
def fitted_heights(
    points: FloatArray,
    firsts: NDArray[np.int64],
    ends: NDArray[np.int64],
    centres: FloatArray,
    heights: FloatArray,
    links: IntArray,
    cell: float,
    limits: FloatArray,
) -> FloatArray:
    """Heights (P,) moved towards the points around them, where these contradict the faces by more than chance.

    The mean of a cell cuts crests off and fills hollows. What points are above or below the faces is shared among the
    corners of the face by their weights. A corner moves by the weighted mean of it if its sum is improbable for
    independent errors of the points.

    Parameters
    ----------
    links : (P, 8) int32
        As in ``kernels.building.patches``.
    limits : (2,) float64
        Points farther from the faces [m] are none of the surface; a weighted sum of errors is improbable above this
        [m] times the root of the sum of the squared weights.
    """
    within, improbable = limits[0], limits[1]
    count = heights.shape[0]
    sums, weights, squares = np.zeros(count), np.zeros(count), np.zeros(count)
    is_used = np.ones(count, dtype=np.bool_)
    for patch in range(count):
        for position in range(firsts[patch], ends[patch]):
            x = (points[position, 0] - centres[patch, 0]) / cell
            y = (points[position, 1] - centres[patch, 1]) / cell
            first, across, last = quad_at(
                patch, EAST if x >= 0.0 else WEST, NORTH if y >= 0.0 else SOUTH, links, is_used
            )
            if first < 0:
                continue
            a, b, c, d = weights_in_quad(abs(x), abs(y), splits_at(patch, first, across, last, heights))
            height = a * heights[patch] + b * heights[first] + c * heights[across] + d * heights[last]
            distance = points[position, 2] - height
            if abs(distance) > within:
                continue
            for corner, weight in ((patch, a), (first, b), (across, c), (last, d)):
                sums[corner] += weight * distance
                weights[corner] += weight
                squares[corner] += weight * weight
    fitted = heights.copy()
    for patch in range(count):
        if abs(sums[patch]) > improbable * np.sqrt(squares[patch]):
            # Half a point more in the denominator: a corner at the edge of all points does not move by one of them.
            fitted[patch] += sums[patch] / (weights[patch] + 0.5)
    return fitted
