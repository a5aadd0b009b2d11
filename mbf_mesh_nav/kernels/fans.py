"""Fans: the groups of faces around a vertex that hang together over edges; a sound vertex has one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel

IntArray = NDArray[np.int32]


@kernel
def fans_at_vertices(
    faces: IntArray, face_neighbours: IntArray, face_offsets: IntArray, incident: IntArray
) -> tuple[IntArray, IntArray]:
    """Fan of every entry of ``incident`` (3F,), counted from 0 at each vertex, and the number of fans (V,)."""
    vertex_count = face_offsets.shape[0] - 1
    fans = np.full(incident.shape[0], -1, dtype=np.int32)
    counts = np.zeros(vertex_count, dtype=np.int32)
    most = 0
    for vertex in range(vertex_count):
        most = max(most, face_offsets[vertex + 1] - face_offsets[vertex])
    waiting = np.zeros(most, dtype=np.int32)
    for vertex in range(vertex_count):
        begin, end = face_offsets[vertex], face_offsets[vertex + 1]
        for entry in range(begin, end):
            if fans[entry] >= 0:
                continue
            fan = counts[vertex]
            counts[vertex] += 1
            fans[entry] = fan
            waiting[0] = entry
            size = 1
            while size > 0:
                size -= 1
                face = incident[waiting[size]]
                for corner in range(3):
                    if faces[face, corner] != vertex and faces[face, (corner + 1) % 3] != vertex:
                        continue
                    other = face_neighbours[face, corner]
                    if other < 0:
                        continue
                    for place in range(begin, end):
                        if incident[place] == other and fans[place] < 0:
                            fans[place] = fan
                            waiting[size] = place
                            size += 1
    return fans, counts
