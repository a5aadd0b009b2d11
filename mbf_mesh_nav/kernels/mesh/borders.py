"""Which positions are past a border of the surface."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel


@kernel
def past_borders(
    mesh_faces: IntArray,
    face_normals: FloatArray,
    face_neighbours: IntArray,
    border_vertices: BoolArray,
    places: FloatArray,
    faces: IntArray,
    barycentric: FloatArray,
    points: FloatArray,
    slack: float,
    least_share: float,
) -> BoolArray:
    """Whether the surface point nearest to places lies on a border, and not below or above them.

    Parameters
    ----------
    mesh_faces, face_neighbours : (F, 3) int32
    face_normals : (F, 3) float64
    border_vertices : (V,) bool
    places : (n, 3) float64
        Positions [m].
    faces, barycentric, points : (n,) int32, (n, 3) float64, (n, 3) float64
        Nearest surface points, see ``Location``.
    slack : float
        So far [m] sideways a position still counts as over its point.
    least_share : float
        A point with less of a corner than this lies on the edge opposite to it.
    """
    past = np.empty(len(faces), dtype=np.bool_)
    for i in range(len(faces)):
        face = Count(faces[i])
        past[i] = False
        if face < 0 or not _on_border(mesh_faces, face_neighbours, border_vertices, barycentric, face, i, least_share):
            continue
        above = 0.0
        for axis in range(3):
            above += (places[i, axis] - points[i, axis]) * face_normals[face, axis]
        squared = 0.0
        for axis in range(3):
            sideways = (places[i, axis] - points[i, axis]) - above * face_normals[face, axis]
            squared += sideways * sideways
        past[i] = math.sqrt(squared) > slack
    return past


@inner_kernel
def _on_border(
    mesh_faces: IntArray,
    face_neighbours: IntArray,
    border_vertices: BoolArray,
    barycentric: FloatArray,
    face: int,
    i: int,
    least_share: float,
) -> bool:
    """Whether point ``i`` lies on a side of its face that has no neighbour, or in a vertex of the border.

    Side k of a face runs from corner k to the next, so it is opposite to the corner after that. In a vertex the face
    may be any of those around it.
    """
    near, vertex = Count(0), Count(0)
    for corner in range(3):
        if barycentric[i, corner] > least_share:
            near, vertex = near + 1, Count(mesh_faces[face, corner])
        elif face_neighbours[face, (corner + 1) % 3] < 0:
            return True
    return near == 1 and bool(border_vertices[vertex])
