"""Pulling a path straight within its corridor, and turning the corridor to the other side of the vertices it bends at.

Within a corridor the shortest path is found by ``funnel.pull_string``. Where it bends round a vertex, the faces on the
other side of that vertex may make it shorter still: if the angle it leaves there is less than half a turn. Turned again
and again, the corridor becomes that of a geodesic, a path that is shortest among its neighbours (Xin and Wang 2007;
Sharp and Crane 2020 turn edges instead of faces). A turn moves the path near by only, so only that part is pulled anew.
"""

from __future__ import annotations

import math

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.mesh.corners import corner_of
from mbf_mesh_nav.kernels.mesh.vectors import Vector, row
from mbf_mesh_nav.kernels.wave.corridor_windows import (
    angle_at,
    faces_round,
    path_length,
    pull_turned,
    spliced,
    turned_corridor,
)
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, fan_length, next_round
from mbf_mesh_nav.kernels.wave.funnel import pull_string

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
    points, marks = pull_string(mesh.vertices, mesh.faces, corridor, start, goal)
    index, tries, is_changed = Count(0), _MAX_TURNS_A_FACE * len(corridor) if turn else Count(0), False
    has_turned = False
    while tries > 0 and len(corridor) > 1:
        if index >= len(corridor) - 1:
            if not is_changed:
                break
            index, is_changed = Count(0), False  # a turn may have made the path bend before it
        vertex = Count(marks[index + 1])
        if vertex < 0:
            index += 1
            continue
        first, last = index, index + 1
        while first > 0 and corner_of(mesh.faces[corridor[first - 1]], vertex) >= 0:
            first -= 1
        while last < len(corridor) - 1 and corner_of(mesh.faces[corridor[last + 1]], vertex) >= 0:
            last += 1
        side = _free_side(mesh, corridor, points, vertex, first, last)
        index = last
        if side < 0:
            continue
        tries -= 1
        fan = faces_round(mesh, corridor, vertex, first, last, side)
        low, high, pulled, pulled_marks = pull_turned(mesh, corridor, points, marks, fan, first, last)
        if path_length(pulled, Count(0), len(pulled) - 1) < path_length(points, low, high):
            points, marks = spliced(points, marks, pulled, pulled_marks, low, high)
            corridor = turned_corridor(corridor, fan, first, last)
            has_turned = is_changed = True
            index = first - 1 if first > 1 else 0
    if has_turned:  # so that the points do not depend on the order of the turns
        points, marks = pull_string(mesh.vertices, mesh.faces, corridor, start, goal)
    return points, corridor


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
    total = angle_at(at, row(points, first), edge)
    face = next_round(mesh, vertex, begin, side)
    while face != end and total < _LESS_THAN_HALF_A_TURN:
        corner = corner_of(mesh.faces[face], vertex)
        total += angle_at(
            at,
            row(mesh.vertices, Count(mesh.faces[face, (corner + 1) % 3])),
            row(mesh.vertices, Count(mesh.faces[face, (corner + 2) % 3])),
        )
        face = next_round(mesh, vertex, face, side)
    corner = corner_of(mesh.faces[end], vertex)
    edge = row(mesh.vertices, Count(mesh.faces[end, (corner + 2) % 3 if side == 0 else (corner + 1) % 3]))
    total += angle_at(at, edge, row(points, Count(last + 1)))
    return side if total < _LESS_THAN_HALF_A_TURN else Count(-1)
