"""Poses of a robot driving along a polyline on the surface: which of its points, and how it stands there."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.surface_walk import tangent
from mbf_mesh_nav.kernels.mesh.vectors import Vector, cross, difference, dot, row, set_row
from mbf_mesh_nav.kernels.prefetch import prefetch

_UNIT_TOLERANCE = 0.01  # of the squared norm of a quaternion, as a ``Path`` has it


@kernel
def points_on_branch(
    predecessors: IntArray, vertex: int, vertices: FloatArray, vertex_normals: FloatArray, turned: bool
) -> tuple[FloatArray, FloatArray]:
    """Positions and normals (n + 2, 3) from ``vertex`` back to the seed it was reached from, or ``turned`` from there.

    The first and the last row are room for a start and a goal.
    """
    count, walker = Count(1), Count(vertex)
    while predecessors[walker] >= 0:
        prefetch(vertices, Index(walker))
        prefetch(vertex_normals, Index(walker))
        walker = Count(predecessors[walker])
        count += 1
    positions, normals = np.empty((count + 2, 3), dtype=np.float64), np.empty((count + 2, 3), dtype=np.float64)
    walker = Count(vertex)
    for place in range(1, count + 1):
        target = count + 1 - place if turned else place
        set_row(positions, target, row(vertices, walker))
        set_row(normals, target, row(vertex_normals, walker))
        walker = Count(predecessors[walker])
    return positions, normals


@kernel
def poses_along(positions: FloatArray, normals: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray, bool]:
    """Positions (m, 3) and quaternions (m, 4), x y z w: each pose stands on its normal and looks to the next one.

    Also whether all positions are finite and all quaternions of unit length.

    Both ends are kept, and of the points between what is farther than ``tolerance`` from the last one kept before;
    what comes that near to the end just before it is dropped, too. A path that passes the place where it ends keeps its
    course there. The heading of the last pose has no meaning.

    Parameters
    ----------
    positions, normals : (n, 3) float64
        At least two points of the path [m] and unit normals of the surface there.
    tolerance : float
        Distance [m].
    """
    last, limit, count = len(positions) - 1, tolerance * tolerance, Count(1)
    kept = np.empty(len(positions), dtype=np.int32)
    kept[0] = 0
    for index in range(1, last):
        step = difference(row(positions, index), row(positions, Count(kept[count - 1])))
        if dot(step, step) > limit:
            kept[count] = index
            count += 1
    end = row(positions, last)
    while count > 1:
        to_end = difference(end, row(positions, Count(kept[count - 1])))
        if dot(to_end, to_end) > limit:
            break
        count -= 1
    kept[count] = last
    count += 1
    points = np.empty((count, 3), dtype=np.float64)
    orientations = np.empty((count, 4), dtype=np.float64)
    sound = True
    for place in range(count):
        point, up = row(positions, Count(kept[place])), row(normals, Count(kept[place]))
        following = row(positions, Count(kept[min(place + 1, count - 1)]))
        ahead = tangent(difference(following, point), up)
        x, y, z, w = _quaternion(ahead, cross(up, ahead), up)
        set_row(points, place, point)
        orientations[place, 0], orientations[place, 1], orientations[place, 2], orientations[place, 3] = x, y, z, w
        sound &= abs(x * x + y * y + z * z + w * w - 1.0) <= _UNIT_TOLERANCE
        sound &= math.isfinite(point[0]) and math.isfinite(point[1]) and math.isfinite(point[2])
    return points, orientations, sound


@inner_kernel
def _quaternion(a: Vector, b: Vector, c: Vector) -> tuple[float, float, float, float]:
    """Quaternion of the frame with the axes a, b, c (Shepperd's method: start from the largest component)."""
    largest = max(max(a[0], b[1]), max(c[2], a[0] + b[1] + c[2]))
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
