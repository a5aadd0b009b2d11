"""Taking faces without area out of a mesh without tearing it apart.

A face whose corners lie on one line joins the two short edges on its one side to the long edge on its other side.
Dropped, it leaves a crack that no planner crosses. So the face across its long edge is split at the middle corner
instead, and where two corners are one point, they are made one vertex.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.defects import faces_without_area
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices
from mbf_mesh_nav.kernels.mesh.slivers import flip_slivers
from mbf_mesh_nav.kernels.mesh.topology import faces_across_edges
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh, edge_lengths
from mbf_mesh_nav.mesh.welding import first_of_group

SAME_POINT_SHARE = 1e-9
"""Corners of a face without area closer than this, in lengths of its longest edge, are one point."""
MAX_PASSES = 300
"""A pass flips once at a vertex, so a fan of slivers takes as many passes as it has faces."""


def without_slivers(mesh: CheckedMesh, tolerance: float) -> tuple[CheckedMesh, int]:
    """Remove the faces of a mesh whose doubled area is at most ``tolerance`` times their longest edge squared.

    Returns
    -------
    mesh : CheckedMesh
    cracks : int
        How many of the faces could not be flipped away and leave their neighbours separated.
    """
    slivers = mesh.faces[faces_without_area(mesh.vertices, mesh.faces, tolerance)]
    mesh = mesh.merged(_same_points(mesh.vertices, slivers))
    mesh = mesh.without_faces((mesh.faces == np.roll(mesh.faces, 1, axis=1)).any(axis=1))
    faces, source = mesh.faces.copy(), mesh.face_source.copy()
    for _ in range(MAX_PASSES):
        flat = faces_without_area(mesh.vertices, faces, tolerance)
        incidence = faces_of_vertices(faces, len(mesh.vertices))
        if not flip_slivers(mesh.vertices, faces, source, flat, *incidence):
            break
    flat = faces_without_area(mesh.vertices, faces, tolerance)
    across = faces_across_edges(faces, *faces_of_vertices(faces, len(mesh.vertices)))[flat]
    long = np.argmax(edge_lengths(mesh.vertices, faces[flat]), axis=1)
    joining = np.take_along_axis(across, long[:, None], axis=1)[:, 0] >= 0
    torn = joining & ((across >= 0).sum(axis=1) > 1)
    return replace(mesh, faces=faces[~flat], face_source=source[~flat]), int(torn.sum())


def _same_points(vertices: FloatArray, slivers: IntArray) -> IntArray:
    """Vertex that stands for each vertex (V,) once the corners of slivers (n, 3) in one place are joined."""
    lengths = edge_lengths(vertices, slivers)
    sliver, corner = np.nonzero(lengths <= SAME_POINT_SHARE * lengths.max(axis=1, keepdims=True))
    pairs = np.stack([slivers[sliver, corner], slivers[sliver, (corner + 1) % 3]], axis=1)
    return first_of_group(pairs, len(vertices))
