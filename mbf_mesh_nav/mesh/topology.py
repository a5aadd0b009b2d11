"""The geometry of a mesh map as flat arrays: adjacency, edge lengths and normals.

Vertices and faces are renumbered along a Morton curve first: neighbours on the surface then lie close in memory,
which makes every wave over the mesh three to four times faster on files with a random order. Callers see their own
numbering through ``input_to_internal`` and ``internal_to_input``.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh import topology as kernels
from mbf_mesh_nav.kernels.mesh.incidence import faces_of_vertices, groups_of_pairs, neighbours_of_vertices
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh


@dataclass(frozen=True, eq=False)
class MeshTopology:
    """Read-only arrays of one triangle mesh, V vertices, F faces, E edges, in internal numbering.

    Attributes
    ----------
    vertices : (V, 3) float64
        Positions [m].
    faces : (F, 3) int32
        Corners, counter-clockwise seen from above or outside.
    vertex_normals, face_normals : (V, 3), (F, 3) float64
        Unit normals; a vertex has the unweighted mean of its faces'.
    edges : (E, 2) int32
        Undirected edges, smaller vertex first.
    neighbour_offsets, neighbours, neighbour_lengths
        CSR graph: entries ``neighbour_offsets[v]`` to ``neighbour_offsets[v+1]`` hold the vertices next to ``v``
        (int32, ascending) and the edge lengths [m] (float32).
    vertex_face_offsets, vertex_faces : (V+1,), (3F,) int32
        CSR of the faces around every vertex.
    face_neighbours : (F, 3) int32
        ``[f, k]`` is the face across the edge from corner k to corner (k+1) % 3, -1 at a border.
    components : (V,) int32
        Number of the connected component.
    input_to_internal : (V_input,) int32
        Internal vertex of every vertex the caller gave, -1 if a repair dropped it.
    internal_to_input, internal_to_input_faces : (V,), (F,) int32
        The caller's number of every vertex and face, -1 if densifying or a repair made it.
    """

    vertices: FloatArray
    faces: IntArray
    vertex_normals: FloatArray
    face_normals: FloatArray
    edges: IntArray
    neighbour_offsets: IntArray
    neighbours: IntArray
    neighbour_lengths: Float32Array
    vertex_face_offsets: IntArray
    vertex_faces: IntArray
    face_neighbours: IntArray
    components: IntArray
    input_to_internal: IntArray
    internal_to_input: IntArray
    internal_to_input_faces: IntArray

    def __post_init__(self) -> None:
        for field in fields(self):
            getattr(self, field.name).flags.writeable = False

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return len(self.vertices)

    @cached_property
    def mean_edge_length(self) -> float:
        """Mean length of the edges [m], the natural unit of steps over the mesh; 1 without edges."""
        return float(np.mean(self.neighbour_lengths)) if len(self.neighbour_lengths) else 1.0

    @cached_property
    def border_vertices(self) -> BoolArray:
        """Vertices (V,) at the boundary of the mesh and of its holes."""
        face, corner = np.nonzero(self.face_neighbours < 0)
        border = np.zeros(len(self.vertices), dtype=np.bool_)
        border[self.faces[face, corner]] = border[self.faces[face, (corner + 1) % 3]] = True
        return border

    @cached_property
    def surface(self) -> Surface:
        """Those of the arrays that kernels take as one argument."""
        return Surface(*(getattr(self, name) for name in Surface._fields))

    def digest(self) -> str:
        """Hexadecimal SHA-256 of vertices and faces: the identity of the mesh in caches."""
        digest = hashlib.sha256(self.vertices.tobytes())
        digest.update(self.faces.tobytes())
        return digest.hexdigest()


def build_topology(mesh: CheckedMesh) -> MeshTopology:
    """Sort a mesh along a Morton curve and build all neighbour arrays."""
    vertices, faces = mesh.vertices, mesh.faces
    centroids = (vertices[faces[:, 0]] + vertices[faces[:, 1]] + vertices[faces[:, 2]]) / 3.0
    vertex_order, face_order = morton_order(vertices, vertices), morton_order(centroids, vertices)
    position = np.zeros(len(vertices), dtype=np.int32)
    position[vertex_order] = np.arange(len(vertices), dtype=np.int32)
    sorted_vertices = np.ascontiguousarray(vertices[vertex_order], dtype=np.float64)
    sorted_faces = np.ascontiguousarray(position[faces[face_order]])

    face_offsets, incident = faces_of_vertices(sorted_faces, len(sorted_vertices))
    offsets, neighbours = neighbours_of_vertices(sorted_faces, face_offsets, incident)
    edges, lengths = kernels.edges_of_neighbours(sorted_vertices, offsets, neighbours)
    face_normals = kernels.unit_face_normals(sorted_vertices, sorted_faces)
    return MeshTopology(
        vertices=sorted_vertices,
        faces=sorted_faces,
        vertex_normals=kernels.unit_vertex_normals(face_normals, face_offsets, incident),
        face_normals=face_normals,
        edges=edges,
        neighbour_offsets=offsets,
        neighbours=neighbours,
        neighbour_lengths=lengths,
        vertex_face_offsets=face_offsets,
        vertex_faces=incident,
        face_neighbours=kernels.faces_across_edges(sorted_faces, face_offsets, incident),
        components=group_of_each(edges, len(vertices)),
        input_to_internal=np.where(mesh.input_to_vertex >= 0, position[mesh.input_to_vertex], -1).astype(np.int32),
        internal_to_input=mesh.vertex_source[vertex_order],
        internal_to_input_faces=mesh.face_source[face_order],
    )


def morton_order(points: FloatArray, around: FloatArray) -> NDArray[np.int64]:
    """Order of points (n, 3) along the Morton curve of the bounding cube of the points ``around`` (m, 3)."""
    lower = around.min(axis=0)
    cell = max(float((around.max(axis=0) - lower).max()), 1e-12) / (2**21 - 1)
    return np.argsort(kernels.morton_codes(points, lower, cell), kind="stable")


def group_of_each(pairs: NDArray[np.integer], count: int) -> IntArray:
    """Number (count,) of the group of each of ``count`` things, where the two of each of the pairs (n, 2) share one."""
    return groups_of_pairs(np.ascontiguousarray(pairs, dtype=np.int32), count)
