"""The arrays of a mesh as kernels take them: one argument instead of eight."""

from __future__ import annotations

from typing import NamedTuple

from mbf_mesh_nav.arrays import FloatArray, IntArray


class Surface(NamedTuple):
    """Arrays of a ``MeshTopology``, described there."""

    vertices: FloatArray
    faces: IntArray
    face_normals: FloatArray
    face_neighbours: IntArray
    vertex_face_offsets: IntArray
    vertex_faces: IntArray
    neighbour_offsets: IntArray
    neighbours: IntArray
