"""Corner records: for every (vertex, incident face) where its three edge weights stand in the CSR arrays.

A wave that unfolds triangles needs, at each incident face of a vertex, the two other corners and three edge weights.
The record is three slots into ``neighbours`` and ``edge_weights``: towards the first other corner (counter-clockwise),
towards the second, and the edge between those two. It depends on the mesh alone. ``neighbours[slots[:, :2]]`` are the
records' ends and ``edge_weights[slots]`` their weights: with these two gathered the wave reads 20 bytes a record, one
after the other, and never searches for a face or an edge. New costs need the weights gathered again, a tenth of a wave.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.dijkstra import Int32Array


@kernel
def build_corner_slots(
    faces: Int32Array,
    vertex_face_offsets: Int32Array,
    vertex_faces: Int32Array,
    neighbour_offsets: Int32Array,
    neighbours: Int32Array,
) -> Int32Array:
    """Corner records (3F, 3) int32, aligned with ``vertex_faces``: slots of v->a, v->b, a->b; (v, a, b) is ccw."""
    slots = np.empty((len(vertex_faces), 3), dtype=np.int32)
    for vertex in range(len(vertex_face_offsets) - 1):
        for record in range(vertex_face_offsets[vertex], vertex_face_offsets[vertex + 1]):
            face = faces[vertex_faces[record]]
            corner = 0
            while face[corner] != vertex:
                corner += 1
            first, second = face[(corner + 1) % 3], face[(corner + 2) % 3]
            slots[record, 0] = _slot(neighbour_offsets, neighbours, Count(vertex), Count(first))
            slots[record, 1] = _slot(neighbour_offsets, neighbours, Count(vertex), Count(second))
            slots[record, 2] = _slot(neighbour_offsets, neighbours, Count(first), Count(second))
    return slots


@inner_kernel
def _slot(neighbour_offsets: Int32Array, neighbours: Int32Array, vertex: int, other: int) -> int:
    slot = neighbour_offsets[vertex]
    while neighbours[slot] != other:
        slot += 1
    return int(slot)
