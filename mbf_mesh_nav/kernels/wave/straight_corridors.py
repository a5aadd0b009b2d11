"""Pulling a path straight within its corridor, and turning the corridor to the other side of the vertices it bends at.

Within a corridor the shortest path is found by ``funnel.pull_string``. Where it bends round a vertex, the faces on the
other side of that vertex may make it shorter still: if the angle it leaves there is less than half a turn. Turned again
and again, the corridor becomes that of a geodesic, a path that is shortest among its neighbours (Xin and Wang 2007;
Sharp and Crane 2020 turn edges instead of faces).
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.corners import corner_of
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, norm, row
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, fan_length, next_round
from mbf_mesh_nav.kernels.wave.funnel import pull_string

_AT_VERTEX = 1e-7  # m; a crossing this near to the end of a portal is that vertex
_LESS_THAN_HALF_A_TURN = math.pi - 1e-6
_MAX_TURNS_A_FACE = 50  # tries; a bound, a traced corridor needs a turn for few of its faces


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
