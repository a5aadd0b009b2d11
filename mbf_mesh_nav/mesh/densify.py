"""Splitting the faces of a coarse mesh until no edge is longer than a limit.

Layers and planners sample the surface at its vertices, so a wall of two large triangles needs vertices in between
before costs on it mean anything. Every split edge gets one midpoint shared by both of its faces, hence the mesh stays
closed where it was closed; the surface itself does not change. The number of faces grows with the square of the
refinement: a limit on it stops a mistyped length.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh, edge_lengths
from mbf_mesh_nav.mesh.mesh_report import MeshError


def densify(
    mesh: CheckedMesh, max_edge_length: float, max_faces: int = 20_000_000, file: str = "arrays"
) -> CheckedMesh:
    """Split all edges longer than ``max_edge_length`` [m] at their middle, until there is none.

    New vertices come after the old ones and have source -1; new faces keep the source of the face they split. ``file``
    is named in the error.

    Raises
    ------
    MeshError
        The length is not positive or the result would have more than ``max_faces`` faces.
    """
    if max_edge_length <= 0.0:
        raise MeshError(file, [f"densify: the maximal edge length must be positive, got {max_edge_length}"])
    vertices, faces, face_source = mesh.vertices, mesh.faces, mesh.face_source
    while True:
        is_long = edge_lengths(vertices, faces) > max_edge_length
        if not is_long.any():
            break
        if len(faces) + int(is_long.sum()) > max_faces:
            text = f"densify: edges of at most {max_edge_length:g} m need more than {max_faces} faces"
            raise MeshError(file, [text])
        # Only long edges are numbered, each by one integer of both ends: sorting all as pairs took most of the time.
        keys, edge_of_corner = np.unique(_edge_keys(faces, len(vertices))[is_long], return_inverse=True)
        middles = np.full(faces.shape, -1, dtype=np.int32)
        middles[is_long] = len(vertices) + edge_of_corner
        ends = vertices[keys // len(vertices)], vertices[keys % len(vertices)]
        vertices = np.vstack([vertices, (ends[0] + ends[1]) / 2.0])
        faces, parents = _split(faces, middles)
        face_source = face_source[parents]
    added = np.full(len(vertices) - len(mesh.vertices), -1, dtype=np.int32)
    vertex_source = np.concatenate([mesh.vertex_source, added])
    return replace(mesh, vertices=vertices, faces=faces, vertex_source=vertex_source, face_source=face_source)


def _edge_keys(faces: IntArray, count: int) -> NDArray[np.int64]:
    """Numbers (F, 3) of the edges from corner k to corner k+1, the same for both faces of an edge."""
    other = np.roll(faces, -1, axis=1)
    return np.minimum(faces, other).astype(np.int64) * count + np.maximum(faces, other)


def _split(faces: IntArray, middles: IntArray) -> tuple[IntArray, NDArray[np.intp]]:
    """Replace every face by one to four; return them and the parent of each.

    ``middles`` (F, 3) holds the new vertex on the edge corner k -> k+1, or -1. Faces are turned until the pattern of
    split edges is (no, no, no), (yes, no, no), (yes, yes, no) or (yes, yes, yes).
    """
    split = middles >= 0
    count = split.sum(axis=1)
    turn = np.where(count == 2, (np.argmin(split, axis=1) + 1) % 3, np.argmax(split, axis=1))
    order = (turn[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, order, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, order, axis=1).T
    patterns = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    new_faces, parents = [], []
    for pieces, triangles in patterns.items():
        chosen = np.flatnonzero(count == pieces)
        for triangle in triangles:
            new_faces.append(np.column_stack([corner[chosen] for corner in triangle]))
            parents.append(chosen)
    return np.ascontiguousarray(np.vstack(new_faces), dtype=np.int32), np.concatenate(parents)
