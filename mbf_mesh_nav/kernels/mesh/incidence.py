"""Which faces and vertices lie at a vertex, and what is connected, in time linear in the faces.

SciPy's sparse arrays and graphs do the same; to import them takes an eighth of the time of ``mbf plan``.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import IntArray
from mbf_mesh_nav.kernels.compiled import Count, kernel
from mbf_mesh_nav.kernels.fill import fill


@kernel
def faces_of_vertices(faces: IntArray, vertex_count: int) -> tuple[IntArray, IntArray]:
    """Incident faces of every vertex as CSR: offsets (V+1,), faces (3F,), int32, ascending within a vertex."""
    offsets = np.empty(vertex_count + 1, dtype=np.int32)
    fill(offsets, Count(0))
    for face in range(faces.shape[0]):
        for corner in range(3):
            offsets[faces[face, corner] + 1] += 1
    cursor = np.empty(vertex_count, dtype=np.int32)
    for vertex in range(vertex_count):
        cursor[vertex] = offsets[vertex]
        offsets[vertex + 1] += offsets[vertex]
    incident = np.empty(3 * faces.shape[0], dtype=np.int32)
    for face in range(faces.shape[0]):
        for corner in range(3):
            vertex = faces[face, corner]
            incident[cursor[vertex]] = face
            cursor[vertex] += 1
    return offsets, incident


@kernel
def neighbours_of_vertices(faces: IntArray, face_offsets: IntArray, incident: IntArray) -> tuple[IntArray, IntArray]:
    """Vertices next to every vertex over edges as CSR: offsets (V+1,), neighbours (2E,), int32, ascending, each once.

    Vertices enter themselves with their neighbours in ascending order, so every list is ascending without a sort.
    """
    vertex_count = face_offsets.shape[0] - 1
    offsets, cursor = np.empty(vertex_count + 1, dtype=np.int32), np.empty(vertex_count, dtype=np.int32)
    neighbours = np.empty(0, dtype=np.int32)
    entered = np.empty(vertex_count, dtype=np.int32)  # the last vertex that each has got
    fill(offsets, Count(0))
    for counts in (True, False):
        fill(entered, Count(-1))
        for vertex in range(vertex_count):
            for position in range(face_offsets[vertex], face_offsets[vertex + 1]):
                for corner in range(3):
                    other = faces[incident[position], corner]
                    if other == vertex or entered[other] == vertex:
                        continue
                    entered[other] = vertex
                    if counts:
                        offsets[other + 1] += 1
                    else:
                        neighbours[cursor[other]] = vertex
                        cursor[other] += 1
        if counts:
            for vertex in range(vertex_count):
                cursor[vertex] = offsets[vertex]
                offsets[vertex + 1] += offsets[vertex]
            neighbours = np.empty(Count(offsets[vertex_count]), dtype=np.int32)
    return offsets, neighbours


@kernel
def groups_of_pairs(pairs: IntArray, count: int) -> IntArray:
    """Number (count,) int32 of the group of each of ``count`` things, where both of each of the pairs (n, 2) share one.

    Groups are numbered in the order of their first members. By union and find: things lead to an earlier one of theirs.
    """
    leader = np.empty(count, dtype=np.int32)
    for thing in range(count):
        leader[thing] = thing
    for pair in range(pairs.shape[0]):
        one, other = pairs[pair, 0], pairs[pair, 1]
        while leader[one] != one:
            leader[one] = leader[leader[one]]
            one = leader[one]
        while leader[other] != other:
            leader[other] = leader[leader[other]]
            other = leader[other]
        if one < other:
            leader[other] = one
        else:
            leader[one] = other
    groups = 0
    for thing in range(count):  # in place: leaders come first, and have their number already
        if leader[thing] == thing:
            leader[thing] = groups
            groups += 1
        else:
            leader[thing] = leader[leader[thing]]
    return leader
