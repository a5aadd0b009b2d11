"""Poses of a robot driving along a polyline on the surface: which of its points, and how it stands there."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.kernels.compiled import inner_kernel, kernel
from mbf_mesh_nav.kernels.dijkstra import BoolArray
from mbf_mesh_nav.kernels.surface_walk import tangent
from mbf_mesh_nav.kernels.vectors import Float64Array, Vector, cross, difference, dot, row


@kernel
def distinct_points(positions: Float64Array, tolerance: float) -> BoolArray:
    """Mask (n,) of the points to keep: both ends, and what is farther than this from the point before and the last.

    Parameters
    ----------
    positions : (n, 3) float64
        At least two points of the path [m].
    tolerance : float
        Distance [m].
    """
    last, limit = len(positions) - 1, tolerance * tolerance
    keep = np.empty(len(positions), dtype=np.bool_)
    keep[0] = keep[last] = True
    end, before = row(positions, last), row(positions, 0)
    for index in range(1, last):
        point = row(positions, index)
        to_end, step = difference(end, point), difference(point, before)
        keep[index] = dot(to_end, to_end) > limit and dot(step, step) > limit
        before = point
    return keep


@kernel
def orientations_along(positions: Float64Array, normals: Float64Array) -> Float64Array:
    """Quaternions (n, 4), x y z w: each pose stands on its normal and looks to the next one, the last any way.

    Parameters
    ----------
    positions, normals : (n, 3) float64
        Points of the path [m] and unit normals of the surface there.
    """
    orientations = np.empty((len(positions), 4), dtype=np.float64)
    for index in range(len(positions)):
        up = row(normals, index)
        following = min(index + 1, len(positions) - 1)
        ahead = tangent(difference(row(positions, following), row(positions, index)), up)
        x, y, z, w = _quaternion(ahead, cross(up, ahead), up)
        orientations[index, 0], orientations[index, 1], orientations[index, 2], orientations[index, 3] = x, y, z, w
    return orientations


@inner_kernel
def _quaternion(a: Vector, b: Vector, c: Vector) -> tuple[float, float, float, float]:
    """Quaternion of the frame with the axes a, b, c (Shepperd's method: start from the largest component)."""
    largest = max(a[0], b[1], c[2], a[0] + b[1] + c[2])
    if largest == a[0]:
        x, y, z, w = 1.0 + a[0] - b[1] - c[2], b[0] + a[1], c[0] + a[2], b[2] - c[1]
    elif largest == b[1]:
        x, y, z, w = b[0] + a[1], 1.0 - a[0] + b[1] - c[2], c[1] + b[2], c[0] - a[2]
    elif largest == c[2]:
        x, y, z, w = c[0] + a[2], c[1] + b[2], 1.0 - a[0] - b[1] + c[2], a[1] - b[0]
    else:
        x, y, z, w = b[2] - c[1], c[0] - a[2], a[1] - b[0], 1.0 + a[0] + b[1] + c[2]
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length
