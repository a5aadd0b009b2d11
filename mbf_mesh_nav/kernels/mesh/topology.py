"""Edges, normals and neighbours across edges of a triangle mesh, in time linear in the faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, Index, kernel
from mbf_mesh_nav.kernels.mesh.vectors import cross, difference, norm, row, set_row, triangle


@kernel
def edges_of_neighbours(vertices: FloatArray, offsets: IntArray, neighbours: IntArray) -> tuple[IntArray, Float32Array]:
    """Enumerate the undirected edges: edges (E, 2) with i < j, and the length per CSR entry.

    Vertices are visited in ascending order and every list is ascending, so the entries of ``u`` that point to larger
    vertices are reached exactly in list order: one cursor per vertex replaces a search.
    """
    vertex_count = offsets.shape[0] - 1
    edges = np.empty((neighbours.shape[0] // 2, 2), dtype=np.int32)
    lengths = np.empty(neighbours.shape[0], dtype=np.float32)
    cursor = np.empty(vertex_count, dtype=np.int32)
    edge_count = 0
    for vertex in range(vertex_count):
        cursor[vertex] = offsets[vertex + 1]
        for entry in range(offsets[vertex], offsets[vertex + 1]):
            other = neighbours[entry]
            if other < vertex:
                twin = cursor[other]
                cursor[other] += 1
                lengths[entry] = lengths[twin]
                continue
            if cursor[vertex] == offsets[vertex + 1]:
                cursor[vertex] = entry
            lengths[entry] = norm(difference(row(vertices, vertex), row(vertices, Count(other))))
            edges[edge_count, 0] = vertex
            edges[edge_count, 1] = other
            edge_count += 1
    return edges, lengths


@kernel
def faces_across_edges(faces: IntArray, face_offsets: IntArray, incident: IntArray) -> IntArray:
    """Face across the edge corner k -> corner k+1 of every face, (F, 3); -1 at a border.

    Of several faces at a non-manifold edge the first one is taken.
    """
    across = np.empty((faces.shape[0], 3), dtype=np.int32)
    for face in range(faces.shape[0]):
        for corner in range(3):
            start = faces[face, corner]
            end = faces[face, (corner + 1) % 3]
            across[face, corner] = -1
            for position in range(face_offsets[start], face_offsets[start + 1]):
                other = incident[position]
                if other != face and (faces[other, 0] == end or faces[other, 1] == end or faces[other, 2] == end):
                    across[face, corner] = other
                    break
    return across


@kernel
def unit_face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Compute unit normals (F, 3), right-handed about the winding; (0, 0, 1) for a face without area."""
    normals = np.empty((faces.shape[0], 3), dtype=np.float64)
    for face in range(faces.shape[0]):
        a, b, c = triangle(vertices, faces, Index(face))
        x, y, z = cross(difference(b, a), difference(c, a))
        length = norm((x, y, z))
        set_row(normals, face, (x / length, y / length, z / length) if length > 0.0 else (0.0, 0.0, 1.0))
    return normals


@kernel
def unit_vertex_normals(face_normals: FloatArray, face_offsets: IntArray, incident: IntArray) -> FloatArray:
    """Unweighted means (V, 3) of the unit normals of the faces around, renormalised; (0, 0, 1) where they vanish."""
    normals = np.empty((face_offsets.shape[0] - 1, 3), dtype=np.float64)
    for vertex in range(face_offsets.shape[0] - 1):
        x = y = z = 0.0
        for position in range(face_offsets[vertex], face_offsets[vertex + 1]):
            normal = row(face_normals, Count(incident[position]))
            x, y, z = x + normal[0], y + normal[1], z + normal[2]
        length = norm((x, y, z))
        set_row(normals, vertex, (x / length, y / length, z / length) if length > 1e-9 else (0.0, 0.0, 1.0))
    return normals


@kernel
def morton_codes(points: FloatArray, lower: FloatArray, cell: float) -> NDArray[np.uint64]:
    """Interleaved 21-bit cell indices of points (n, 3): close codes mean close points."""
    codes = np.empty(points.shape[0], dtype=np.uint64)
    for index in range(points.shape[0]):
        code = np.uint64(0)
        for axis in range(3):
            bits = np.uint64((points[index, axis] - lower[axis]) / cell) & np.uint64(0x1FFFFF)
            bits = (bits | (bits << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
            bits = (bits | (bits << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
            bits = (bits | (bits << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
            bits = (bits | (bits << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
            bits = (bits | (bits << np.uint64(2))) & np.uint64(0x1249249249249249)
            code |= bits << np.uint64(axis)
        codes[index] = code
    return codes
