"""Which samples of a mesh lie on the far side of solids, where nobody can stand and nothing can be seen.

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


def below_all_ground(
    vertices: FloatArray, faces: NDArray[np.integer], points: FloatArray, face_of_point: NDArray[np.integer]
) -> BoolArray:
    """Mask (n,) of points that lie on a solid, on a face that does not look up, with no ground anywhere below.

    The undersides of bridges and ceilings above ground are kept: they leave the robot its free height.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (F, 3) int
    points, face_of_point : (n, 3) float64 [m], (n,) int
        Places on the faces.
    """
    corners = same_position(vertices)[faces]
    outward, is_solid = _normals_of_solids(vertices, corners)
    is_ground = np.where(is_solid, outward, np.abs(outward)) > LOOKS_UP
    mask: BoolArray = (is_solid & ~is_ground)[face_of_point]
    if not (mask.any() and is_ground.any()):
        return mask
    ground = corners[is_ground].astype(np.int32)
    middles = vertices[ground].mean(axis=1)
    ground = ground[morton_order(middles, middles)]
    origins = np.ascontiguousarray(points[mask])
    down = np.tile((0.0, 0.0, -1.0), (len(origins), 1))
    hit, _ = first_hits(vertices, ground, *build_boxes(vertices, ground), origins, down, np.inf)
    mask[mask] = hit < 0
    return mask


def _normals_of_solids(vertices: FloatArray, corners: IntArray) -> tuple[FloatArray, BoolArray]:
    """Upward part of the unit normal of each face (F,), outward on solids, and whether it is one of a solid.

    A solid is a part whose every edge is used as often in one direction as in the other, and whose volume is not 0; it
    may be turned inside out.
    """
    a, b, c = (vertices[corners[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    across = np.cross(b - a, c - a)
    doubles = np.sqrt(np.sum(across * across, axis=1))
    upward = across[:, 2] / np.maximum(doubles, np.finfo(np.float64).tiny)
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    group = group_of_each(np.stack([starts, ends]), len(vertices))
    is_open = np.zeros(len(vertices), dtype=np.bool_)
    is_open[group[_without_opposite(starts, ends, len(vertices))]] = True
    of_face = group[corners[:, 0]]
    volumes = np.bincount(of_face, weights=np.sum(a * across, axis=1), minlength=len(vertices))
    return upward * np.where(volumes < 0.0, -1.0, 1.0)[of_face], (~is_open & (volumes != 0.0))[of_face]


def _without_opposite(starts: IntArray, ends: IntArray, count: int) -> IntArray:
    """Start vertices of the edges that are used more often in one direction than in the other."""
    is_edge = starts != ends
    starts, ends = starts[is_edge].astype(np.int64), ends[is_edge].astype(np.int64)
    keys, edge = np.unique(np.minimum(starts, ends) * count + np.maximum(starts, ends), return_inverse=True)
    surplus = np.bincount(edge, weights=np.where(starts < ends, 1.0, -1.0), minlength=len(keys))
    return np.asarray(starts[surplus[edge] != 0.0])
