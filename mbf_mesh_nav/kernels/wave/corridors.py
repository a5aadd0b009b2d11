"""Corridors of free faces along a path: faces of which each shares an edge with the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_array_kernel, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.corners import corner_of


class FreeFaces(NamedTuple):
    """Arrays of a mesh as in ``MeshTopology``, and its blocked vertices (V,); no corridor has a face at one of them."""

    vertices: FloatArray
    faces: IntArray
    face_neighbours: IntArray
    blocked: BoolArray


@kernel
def link_faces(mesh: FreeFaces, point_faces: IntArray) -> tuple[IntArray, IntArray]:
    """Join the faces of a path to corridors in which each shares an edge with the next.

    Parameters
    ----------
    point_faces : (n,) int32
        The face in which the segment to each point lies.

    Returns
    -------
    corridor : (s,) int32
        The faces of all corridors.
    pieces : (p, 4) int32
        Of every piece of the path its first and last point, and where its corridor begins and ends; an empty one where
        the path is not among free faces.
    """
    corridor = np.empty(2 * len(point_faces) + 64, dtype=np.int32)
    pieces = np.empty((len(point_faces), 4), dtype=np.int32)
    count, begin, piece_count, first = Count(0), Count(0), Count(0), Count(0)
    for index in range(1, len(point_faces)):
        following = Count(point_faces[index])
        is_free = not _is_blocked(mesh, following)
        if index > 1:
            linked = Count(-1)
            if is_free and count > begin:
                corridor, linked = _linked(mesh, corridor, begin, count, following)
            if linked >= 0:
                count = linked
                continue
            if not is_free and count == begin:
                continue  # one more point of a piece without a corridor
            _end_piece(pieces, piece_count, first, index - 1, begin, count)
            piece_count, first, begin = piece_count + 1, Count(index - 1), Count(count)
        if is_free:
            if count + 1 > len(corridor):
                corridor = _grown(corridor)
            corridor[count] = following
            count += 1
    _end_piece(pieces, piece_count, first, len(point_faces) - 1, begin, count)
    return corridor[:count].copy(), pieces[: piece_count + 1].copy()


@inner_kernel
def _end_piece(pieces: IntArray, index: int, first: int, last: int, begin: int, end: int) -> None:
    pieces[index, 0], pieces[index, 1], pieces[index, 2], pieces[index, 3] = first, last, begin, end


@inner_array_kernel
def _grown(corridor: IntArray) -> IntArray:
    longer = np.empty(2 * len(corridor), dtype=np.int32)
    for index in range(len(corridor)):
        longer[index] = corridor[index]
    return longer


@inner_kernel
def _is_blocked(mesh: FreeFaces, face: int) -> bool:
    a, b, c = mesh.faces[face, 0], mesh.faces[face, 1], mesh.faces[face, 2]
    return bool(mesh.blocked[a] or mesh.blocked[b] or mesh.blocked[c])


@inner_array_kernel
def _linked(mesh: FreeFaces, corridor: IntArray, begin: int, count: int, following: int) -> tuple[IntArray, int]:
    """Lead the corridor on to a face: at once, or by the shorter free fan round a common vertex; its length, or -1."""
    last = Count(corridor[count - 1])
    if last == following:
        return corridor, count
    for side in range(3):
        if mesh.face_neighbours[last, side] == following:
            return _appended(corridor, begin, count, following)
    for corner in range(3):
        vertex = Count(mesh.faces[last, corner])
        if corner_of(mesh.faces[following], vertex) < 0:
            continue
        left = fan_length(mesh, vertex, last, following, Count(0))
        right = fan_length(mesh, vertex, last, following, Count(2))
        if left < 0 and right < 0:
            return corridor, Count(-1)
        side = Count(0) if right < 0 or 0 <= left < right else Count(2)
        face = last
        while face != following:
            face = next_round(mesh, vertex, face, side)
            corridor, count = _appended(corridor, begin, count, face)
        return corridor, count
    return corridor, Count(-1)


@inner_array_kernel
def _appended(corridor: IntArray, begin: int, count: int, face: int) -> tuple[IntArray, int]:
    """Append a face; into a face and straight back out of it is no step at all."""
    if count - begin > 1 and corridor[count - 2] == face:
        return corridor, count - 1
    if count + 1 > len(corridor):
        corridor = _grown(corridor)
    corridor[count] = face
    return corridor, count + 1


@inner_kernel
def next_round(mesh: FreeFaces, vertex: int, face: int, side: int) -> int:
    """Next face round a vertex over its outgoing (0) or incoming (2) edge; -1 at a border."""
    return Count(mesh.face_neighbours[face, (corner_of(mesh.faces[face], vertex) + side) % 3])  # type: ignore[no-any-return]


@inner_kernel
def fan_length(mesh: FreeFaces, vertex: int, face: int, following: int, side: int) -> int:
    """Steps round a vertex from a face to the following one; -1 if a border or a blocked face lies between.

    Also if the faces touch in the vertex only, then the turn comes back to where it began.
    """
    steps, begin = Count(0), face
    while face != following:
        face = next_round(mesh, vertex, face, side)
        steps += 1
        if face < 0 or face == begin or (face != following and _is_blocked(mesh, face)):
            return Count(-1)  # type: ignore[no-any-return]
    return steps  # type: ignore[no-any-return]
