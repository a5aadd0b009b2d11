"""Corner records: for every (vertex, incident face) the two other corners and the weights of the three edges.

A wave that unfolds triangles needs them at each incident face of a vertex. Written one after the other they are 20
bytes a record, and the wave never searches for a face or an edge. The ends depend on the mesh alone; the weights
follow the map's costs, at the price of what changed. So does what else a wave asks of them: where corners are obtuse.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.compiled import ONE, Count, Index, inlined_kernel, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.prefetch import prefetch
from mbf_mesh_nav.kernels.search.dijkstra import CANCEL_POLL_INTERVAL

ENDS: Any = Index(2)
WEIGHTS: Any = Index(3)
"""Numbers of a record in its arrays without a second dimension."""
TWO: Any = Index(2)
_LAST: Any = Index(5)  # of most vertices, which have six; asking for what lies behind the end does no harm
OBTUSE: Any = np.float32(1.2)  # least ratio of the longest side squared to the others squared: 102 degrees if equal


@kernel
def build_corner_ends(faces: IntArray, vertex_face_offsets: IntArray, vertex_faces: IntArray) -> IntArray:
    """Other corners (3F, 2) int32 of the records, aligned with ``vertex_faces``: (v, first, second) is ccw."""
    ends = np.empty((len(vertex_faces), 2), dtype=np.int32)
    for vertex in range(len(vertex_face_offsets) - 1):
        for record in range(Index(vertex_face_offsets[vertex]), Index(vertex_face_offsets[vertex + 1])):
            face = Index(vertex_faces[record])
            corner = 0
            while faces[face, corner] != vertex:
                corner += 1
            ends[record, 0], ends[record, 1] = faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
    return ends


@kernel
def write_corner_weights(
    vertex_face_offsets: IntArray,
    corner_ends: IntArray,
    neighbour_offsets: IntArray,
    neighbours: IntArray,
    edge_weights: Float32Array,
    changed: IntArray,
    corner_weights: Float32Array,
    obtuse_around: BoolArray,
    cancel_flag: FlagArray,
) -> bool:
    """Write the weights of all records that have an edge at one of the ``changed`` vertices (c,).

    A record's weights (3F, 3) are those of its edges to the first and to the second other corner, and between these.
    ``obtuse_around`` (V,) says whether one of the records of a vertex has an obtuse corner opposite to one of its own
    edges. ``cancel_flag`` (1,) is polled; returns False if it ended the call, and both are good for nothing then.
    """
    is_written = np.empty(len(neighbour_offsets), dtype=np.bool_)
    fill(is_written, Count(0))
    for place in range(len(changed)):
        if place % CANCEL_POLL_INTERVAL == 0 and cancel_flag[0] != 0:
            return False
        center = Index(changed[place])
        for slot in range(Index(neighbour_offsets[center]), Index(neighbour_offsets[center + ONE]) + ONE):
            # Its neighbours, and at last itself.
            vertex = Index(neighbours[slot]) if slot < Index(neighbour_offsets[center + ONE]) else center
            if is_written[vertex]:
                continue
            is_written[vertex], any_obtuse = True, False
            for record in range(Index(vertex_face_offsets[vertex]), Index(vertex_face_offsets[vertex + ONE])):
                first, second = Index(corner_ends[record, 0]), Index(corner_ends[record, 1])
                to_first = edge_weights[slot_of(neighbour_offsets, neighbours, vertex, first)]
                to_second = edge_weights[slot_of(neighbour_offsets, neighbours, vertex, second)]
                between = edge_weights[slot_of(neighbour_offsets, neighbours, first, second)]
                corner_weights[record, 0], corner_weights[record, 1] = to_first, to_second
                corner_weights[record, 2] = between
                any_obtuse |= is_obtuse(max(to_first, to_second), min(to_first, to_second), between)
            obtuse_around[vertex] = any_obtuse
    return True


@inner_kernel
def is_obtuse(c: float, b: float, a: float) -> bool:
    """Whether the corner opposite to side ``c`` is so obtuse that a front may come through that side from afar."""
    return bool(c * c > OBTUSE * (b * b + a * a))


@inlined_kernel
def prefetch_records(corner_ends: IntArray, corner_weights: Float32Array, first: int) -> None:
    """Ask for the records (6F,), (9F,) of a vertex, of which ``first`` is the first, before they are needed."""
    prefetch(corner_ends, first * ENDS)
    prefetch(corner_ends, (first + _LAST) * ENDS)
    prefetch(corner_weights, first * WEIGHTS)
    prefetch(corner_weights, (first + _LAST) * WEIGHTS)


@inner_kernel
def slot_of(neighbour_offsets: IntArray, neighbours: IntArray, vertex: int, other: int) -> int:
    """Where ``other`` stands in the ascending list of a vertex: after all that are less. Without a branch to guess."""
    slot = Index(neighbour_offsets[vertex])
    for entry in range(Index(neighbour_offsets[vertex]), Index(neighbour_offsets[vertex + ONE])):
        slot += Index(Index(neighbours[entry]) < other)
    return slot  # type: ignore[no-any-return]


@inner_kernel
def corner_of(corners: IntArray, vertex: int) -> int:
    """Number of a vertex among the corners of a face, -1 if it is none of them."""
    for corner in range(3):
        if corners[corner] == vertex:
            return Count(corner)  # type: ignore[no-any-return]
    return Count(-1)  # type: ignore[no-any-return]
