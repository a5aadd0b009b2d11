"""Flipping the longest edge of faces without area away, so that the faces around them stay joined."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill


@inner_kernel
def longest_edge(vertices: FloatArray, faces: IntArray, face: int) -> int:
    """Corner at which the longest edge of a face begins."""
    best, longest = 0, -1.0
    for corner in range(3):
        start, end = faces[face, corner], faces[face, (corner + 1) % 3]
        squared = 0.0
        for axis in range(3):
            difference = vertices[start, axis] - vertices[end, axis]
            squared += difference * difference
        if squared > longest:
            best, longest = corner, squared
    return best


@inner_kernel
def has_edge(faces: IntArray, face_offsets: IntArray, incident: IntArray, start: int, end: int) -> bool:
    """Whether a face has both vertices as corners."""
    for position in range(face_offsets[start], face_offsets[start + 1]):
        face = incident[position]
        if faces[face, 0] == end or faces[face, 1] == end or faces[face, 2] == end:
            return True
    return False


@kernel
def flip_slivers(
    vertices: FloatArray,
    faces: IntArray,
    face_source: IntArray,
    flat: BoolArray,
    face_offsets: IntArray,
    incident: IntArray,
) -> int:
    """Split the face across the longest edge of every flat face at the flat one's third corner, as far as possible.

    ``faces`` and ``face_source`` are changed in place, two faces for two. A vertex takes part in one flip only, since
    ``incident`` is not kept up to date; call it again until it returns 0, the number of flips.
    """
    taken = np.empty(vertices.shape[0], dtype=np.bool_)
    fill(taken, Count(0))
    flips = 0
    for face in range(faces.shape[0]):
        if not flat[face]:
            continue
        corner = longest_edge(vertices, faces, face)
        p, q, m = faces[face, corner], faces[face, (corner + 1) % 3], faces[face, (corner + 2) % 3]
        if p == q or q == m or m == p or taken[p] or taken[q] or taken[m]:
            continue
        other, others, begin = -1, 0, 0
        for position in range(face_offsets[p], face_offsets[p + 1]):
            candidate = incident[position]
            if candidate == face:
                continue
            for side in range(3):
                start, end = faces[candidate, side], faces[candidate, (side + 1) % 3]
                if (start == p and end == q) or (start == q and end == p):
                    other, begin = candidate, side
                    others += 1
        if others != 1:
            continue
        u, v, r = faces[other, begin], faces[other, (begin + 1) % 3], faces[other, (begin + 2) % 3]
        # A flat face is split only by one with the same longest edge: lengths shrink, so the flips come to an end.
        if flat[other] and longest_edge(vertices, faces, other) != begin:
            continue
        if r == m or r == p or r == q or taken[r] or has_edge(faces, face_offsets, incident, m, r):
            continue
        faces[other, 0], faces[other, 1], faces[other, 2] = u, m, r
        faces[face, 0], faces[face, 1], faces[face, 2] = m, v, r
        face_source[face] = face_source[other]
        taken[p] = taken[q] = taken[m] = taken[r] = True
        flips += 1
    return flips
