"""Which samples of a mesh lie where no robot can be: on the far side of solids, and in gaps too low for it.

Models of buildings are solids, and surfaces by Poisson's method close below the ground. Both sides of a slab would pass
for one noisy ground between them. When not to use: for scans, which have no inside.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.bounding_boxes import build_boxes
from mbf_mesh_nav.kernels.mesh.rays import first_hits
from mbf_mesh_nav.mesh.topology import group_of_each, morton_order
from mbf_mesh_nav.mesh.welding import same_position

LOOKS_UP = 0.1
"""Least z of the unit normal of what can be ground; steeper than 84 degrees is a wall."""
TOUCHING = 1e-3
"""A face is looked at from so far [m] outside, where it may be inside another solid: a wall stands on its floor."""


def out_of_reach(
    vertices: FloatArray,
    faces: NDArray[np.integer],
    points: FloatArray,
    face_of_point: NDArray[np.integer],
    clearance: float,
) -> BoolArray:
    """Mask (n,) of points on solids that no robot can be at: below all ground, or where it does not fit.

    A face of a solid that does not look up is left out where no ground lies below it. Where ground lies less than
    ``clearance`` [m] below a ceiling, both are left out, such as the underside of a ramp and the floor below it, and so
    is ground inside another solid. Higher ceilings are kept, and what stands on the ground.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (F, 3) int
    points, face_of_point : (n, 3) float64 [m], (n,) int
        Places on the faces.
    """
    corners = same_position(vertices)[faces].astype(np.int32)
    normals, is_solid = _normals_of_solids(vertices, corners)
    is_ground, is_ceiling = normals[:, 2] > LOOKS_UP, is_solid & (normals[:, 2] < -LOOKS_UP)
    outside = points + TOUCHING * normals[face_of_point]
    free = _gaps(vertices, corners[is_ceiling], outside, 1.0)
    is_inside = _gaps(vertices, corners[is_solid & is_ground], outside, 1.0) < free
    mask: BoolArray = is_inside | (is_ground[face_of_point] & (free < clearance))
    rest = ~mask & (is_solid & ~is_ground)[face_of_point]
    below = _gaps(vertices, corners[is_ground], outside[rest], -1.0)
    mask[rest] = np.isinf(below) | (is_ceiling[face_of_point[rest]] & (below < clearance))
    return mask


def _gaps(vertices: FloatArray, faces: IntArray, points: FloatArray, up: float) -> FloatArray:
    """Distances (n,) [m] from points straight up (1) or down (-1) to the first of the faces; inf = none."""
    if not (len(faces) and len(points)):
        return np.full(len(points), np.inf)
    middles = vertices[faces].mean(axis=1)
    ordered = np.ascontiguousarray(faces[morton_order(middles, middles)])
    directions = np.tile((0.0, 0.0, up), (len(points), 1))
    return np.asarray(first_hits(vertices, ordered, *build_boxes(vertices, ordered), points, directions, np.inf)[1])


def _normals_of_solids(vertices: FloatArray, corners: IntArray) -> tuple[FloatArray, BoolArray]:
    """Unit normal (F, 3) of each face, outward on solids and upward on others; and whether it is one of a solid.

    A solid is a part whose every edge is used as often in one direction as in the other, and whose volume is not 0; it
    may be turned inside out.
    """
    a, b, c = (vertices[corners[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    across = np.cross(b - a, c - a)
    doubles = np.sqrt(np.sum(across * across, axis=1))
    normals = across / np.maximum(doubles, np.finfo(np.float64).tiny)[:, None]
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    group = group_of_each(np.stack([starts, ends], axis=1), len(vertices))
    is_open = np.zeros(len(vertices), dtype=np.bool_)
    is_open[group[_without_opposite(starts, ends, len(vertices))]] = True
    of_face = group[corners[:, 0]]
    volumes = np.bincount(of_face, weights=np.sum(a * across, axis=1), minlength=len(vertices))
    is_solid = (~is_open & (volumes != 0.0))[of_face]
    outward = np.where(volumes < 0.0, -1.0, 1.0)[of_face]
    sign = np.where(is_solid, outward, np.where(normals[:, 2] < 0.0, -1.0, 1.0))
    return normals * sign[:, None], is_solid


def _without_opposite(starts: IntArray, ends: IntArray, count: int) -> IntArray:
    """Start vertices of the edges that are used more often in one direction than in the other."""
    is_edge = starts != ends
    starts, ends = starts[is_edge].astype(np.int64), ends[is_edge].astype(np.int64)
    keys, edge = np.unique(np.minimum(starts, ends) * count + np.maximum(starts, ends), return_inverse=True)
    surplus = np.bincount(edge, weights=np.where(starts < ends, 1.0, -1.0), minlength=len(keys))
    return np.asarray(starts[surplus[edge] != 0.0])
