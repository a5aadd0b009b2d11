"""Corridors of free faces along a path, and turning them to the other side of the vertices at which the path bends.

Within a corridor the shortest path is found by ``funnel.pull_string``. Where it bends round a vertex, the faces on the
other side of that vertex may make it shorter still: if the angle it leaves there is less than half a turn. Turned again
and again, the corridor becomes that of a geodesic, a path that is shortest among its neighbours (Xin and Wang 2007;
Sharp and Crane 2020 turn edges instead of faces).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, norm, row
from mbf_mesh_nav.kernels.wave.funnel import pull_string

_AT_VERTEX = 1e-7  # m; a crossing this near to the end of a portal is that vertex
_LESS_THAN_HALF_A_TURN = math.pi - 1e-6
_MAX_TURNS_A_FACE = 50  # tries; a bound, a traced corridor needs a turn for few of its faces


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


@inner_kernel
def _grown(corridor: IntArray) -> IntArray:
    longer = np.empty(2 * len(corridor), dtype=np.int32)
    for index in range(len(corridor)):
        longer[index] = corridor[index]
    return longer


@inner_kernel
def _is_blocked(mesh: FreeFaces, face: int) -> bool:
    a, b, c = mesh.faces[face, 0], mesh.faces[face, 1], mesh.faces[face, 2]
    return bool(mesh.blocked[a] or mesh.blocked[b] or mesh.blocked[c])


@inner_kernel
def corner_of(corners: IntArray, vertex: int) -> int:
    """Number of a vertex among the corners of a face, -1 if it is none of them."""
    for corner in range(3):
        if corners[corner] == vertex:
            return Count(corner)  # type: ignore[no-any-return]
    return Count(-1)  # type: ignore[no-any-return]


@inner_kernel
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


@inner_kernel
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


@inner_kernel
def other_side(mesh: FreeFaces, corridor: IntArray, vertex: int, first: int, last: int) -> int:
    """Edge (0, 2) over which the free fan on the other side of a vertex begins that leads from one face to another.

    ``first`` and ``last`` number faces of the corridor; -1 if that fan is not free.
    """
    begin, end = Count(corridor[first]), Count(corridor[last])
    side = Count(2) if next_round(mesh, vertex, begin, Count(0)) == Count(corridor[first + 1]) else Count(0)
    if begin == end or fan_length(mesh, vertex, begin, end, side) < 0:
        return Count(-1)  # type: ignore[no-any-return]
    return side  # type: ignore[no-any-return]


@kernel
def straighten(
    mesh: FreeFaces, corridor: IntArray, start: Vector, goal: Vector, turn: bool
) -> tuple[FloatArray, IntArray]:
    """Pull the string through a corridor and turn the corridor round the vertices where that makes the path shorter.

    Parameters
    ----------
    corridor : (s,) int32
        Faces, each sharing an edge with the next.
    start, goal : (float, float, float)
        Points in the first and the last face [m].
    turn : bool
        Whether the corridor may be turned; without it the path is that of ``pull_string``.

    Returns
    -------
    points : (n + 1, 3) float64
        Start, one point on each crossed edge, goal.
    corridor : (n,) int32
        The faces the path goes through.
    """
    points = pull_string(mesh.vertices, mesh.faces, corridor, start, goal)
    length = path_length(points)
    index, tries, is_changed = Count(0), _MAX_TURNS_A_FACE * len(corridor) if turn else Count(0), False
    while tries > 0 and len(corridor) > 1:
        if index >= len(corridor) - 1:
            if not is_changed:
                break
            index, is_changed = Count(0), False  # a turn may have made the path bend before it
        vertex = _bend_at(mesh, corridor, points, index)
        if vertex < 0:
            index += 1
            continue
        first, last = index, index + 1
        while first > 0 and corner_of(mesh.faces[corridor[first - 1]], vertex) >= 0:
            first -= 1
        while last < len(corridor) - 1 and corner_of(mesh.faces[corridor[last + 1]], vertex) >= 0:
            last += 1
        side = _free_side(mesh, corridor, points, vertex, first, last)
        turned = corridor if side < 0 else turned_corridor(mesh, corridor, vertex, first, last, side)
        index = last
        if side < 0:
            continue
        tries -= 1
        shorter = pull_string(mesh.vertices, mesh.faces, turned, start, goal)
        new_length = path_length(shorter)
        if new_length < length:
            points, corridor, length, is_changed = shorter, turned, new_length, True
            index = max(first - 1, 0)
    return points, corridor


@inner_kernel
def path_length(points: FloatArray) -> float:
    """Length [m] of a polyline (n, 3)."""
    total = 0.0
    for index in range(len(points) - 1):
        total += norm(difference(row(points, index + 1), row(points, index)))
    return total


@inner_kernel
def _bend_at(mesh: FreeFaces, corridor: IntArray, points: FloatArray, portal: int) -> int:
    """Vertex at an end of a portal through which the path goes, else -1."""
    following, crossing = mesh.faces[corridor[portal + 1]], row(points, Count(portal + 1))
    for corner in range(3):
        vertex = Count(mesh.faces[corridor[portal], corner])
        if corner_of(following, vertex) >= 0 and norm(difference(row(mesh.vertices, vertex), crossing)) < _AT_VERTEX:
            return vertex  # type: ignore[no-any-return]
    return Count(-1)  # type: ignore[no-any-return]


@inner_kernel
def _angle(at: Vector, first: Vector, second: Vector) -> float:
    a, b = difference(first, at), difference(second, at)
    return math.acos(min(max(dot(a, b) / max(norm(a) * norm(b), 1e-300), -1.0), 1.0))


@inner_kernel
def _free_side(mesh: FreeFaces, corridor: IntArray, points: FloatArray, vertex: int, first: int, last: int) -> int:
    """As ``other_side``; -1 also if the path leaves an angle of half a turn or more there."""
    side = other_side(mesh, corridor, vertex, first, last)
    if side < 0:
        return side
    begin, end = Count(corridor[first]), Count(corridor[last])
    # The path comes to the vertex from the point before face ``first`` and leaves it to the one behind ``last``.
    at = row(mesh.vertices, vertex)
    corner = corner_of(mesh.faces[begin], vertex)
    # Over the outgoing edge the face is left between the vertex and the next corner, else the one before.
    edge = row(mesh.vertices, Count(mesh.faces[begin, (corner + 1) % 3 if side == 0 else (corner + 2) % 3]))
    total = _angle(at, row(points, first), edge)
    face = next_round(mesh, vertex, begin, side)
    while face != end and total < _LESS_THAN_HALF_A_TURN:
        corner = corner_of(mesh.faces[face], vertex)
        total += _angle(
            at,
            row(mesh.vertices, Count(mesh.faces[face, (corner + 1) % 3])),
            row(mesh.vertices, Count(mesh.faces[face, (corner + 2) % 3])),
        )
        face = next_round(mesh, vertex, face, side)
    corner = corner_of(mesh.faces[end], vertex)
    edge = row(mesh.vertices, Count(mesh.faces[end, (corner + 2) % 3 if side == 0 else (corner + 1) % 3]))
    total += _angle(at, edge, row(points, Count(last + 1)))
    return side if total < _LESS_THAN_HALF_A_TURN else Count(-1)


@inner_kernel
def turned_corridor(mesh: FreeFaces, corridor: IntArray, vertex: int, first: int, last: int, side: int) -> IntArray:
    """The corridor led round the other side of a vertex between two of its faces."""
    between, face, end = Count(0), next_round(mesh, vertex, Count(corridor[first]), side), corridor[last]
    while face != end:
        face = next_round(mesh, vertex, face, side)
        between += 1
    turned = np.empty(first + 1 + between + len(corridor) - last, dtype=np.int32)
    for index in range(first + 1):
        turned[index] = corridor[index]
    face = Count(corridor[first])
    for index in range(between):
        face = next_round(mesh, vertex, face, side)
        turned[first + 1 + index] = face
    for index in range(last, len(corridor)):
        turned[first + 1 + between + index - last] = corridor[index]
    return turned
