"""Fans: the groups of faces around a vertex that hang together over edges; a sound vertex has one."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.compiled import kernel


def fans_at_vertices(
    faces: IntArray, face_neighbours: IntArray, face_offsets: IntArray, incident: IntArray
) -> tuple[IntArray, IntArray]:
    """Fan of every entry of ``incident`` (3F,), counted from 0 at each vertex, and the number of fans (V,)."""
    fans = np.full(len(incident), -1, dtype=np.int32)
    counts = np.zeros(len(face_offsets) - 1, dtype=np.int32)
    waiting = np.zeros(np.diff(face_offsets).max(initial=0), dtype=np.int32)
    label_fans(faces, face_neighbours, face_offsets, incident, fans, counts, waiting)
    return fans, counts


@kernel
def label_fans(
    faces: IntArray,
    face_neighbours: IntArray,
    face_offsets: IntArray,
    incident: IntArray,
    fans: IntArray,
    counts: IntArray,
    waiting: IntArray,
) -> None:
    """Fill ``fans``, -1 so far, and ``counts``; ``waiting`` has room for the faces around any vertex."""
    for vertex in range(counts.shape[0]):
        begin, end = face_offsets[vertex], face_offsets[vertex + 1]
        for entry in range(begin, end):
            if fans[entry] >= 0:
                continue
            fan = counts[vertex]
            counts[vertex] = fan + 1
            fans[entry] = fan
            waiting[0] = incident[entry]
            size = 1
            while size > 0:
                size -= 1
                face = waiting[size]
                for corner in range(3):
                    if faces[face, corner] != vertex and faces[face, (corner + 1) % 3] != vertex:
                        continue
                    for place in range(begin, end):
                        if incident[place] == face_neighbours[face, corner] and fans[place] < 0:
                            fans[place] = fan
                            waiting[size] = incident[place]
                            size += 1
