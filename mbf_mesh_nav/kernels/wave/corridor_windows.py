"""Turning a corridor round one vertex, and pulling only the part of the string that this moves.

A string that bends at a vertex stays as it is beyond that as long as it goes on to bend there. So the part from the
bend before the turned vertex to the bend behind it is pulled anew; where it then would cut one of these corners, the
part becomes longer by one bend after the other.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_array_kernel, inner_kernel
from mbf_mesh_nav.kernels.mesh.corners import corner_of
from mbf_mesh_nav.kernels.mesh.vectors import Vector, difference, dot, norm, row, set_row
from mbf_mesh_nav.kernels.wave.corridors import FreeFaces, next_round
from mbf_mesh_nav.kernels.wave.funnel import pull_string

_HALF_A_TURN = math.pi - 1e-9


@inner_kernel
def path_length(points: FloatArray, first: int, last: int) -> float:
    """Length [m] of a polyline (n, 3) from one of its rows to another."""
    total = 0.0
    for index in range(first, last):
        total += norm(difference(row(points, Count(index + 1)), row(points, Count(index))))
    return total


@inner_array_kernel
def faces_round(mesh: FreeFaces, corridor: IntArray, vertex: int, first: int, last: int, side: int) -> IntArray:
    """The faces (n,) on the other side of a vertex between two faces of a corridor, without these."""
    count, face, end = Count(0), next_round(mesh, vertex, Count(corridor[first]), side), corridor[last]
    while face != end:
        face = next_round(mesh, vertex, face, side)
        count += 1
    fan, face = np.empty(count, dtype=np.int32), Count(corridor[first])
    for index in range(count):
        face = next_round(mesh, vertex, face, side)
        fan[index] = face
    return fan


@inner_array_kernel
def turned_corridor(corridor: IntArray, fan: IntArray, first: int, last: int) -> IntArray:
    """The corridor with other faces between two of its faces."""
    return _part_with_fan(corridor, fan, first, last, Count(0), Count(len(corridor)))


@inner_array_kernel
def _part_with_fan(corridor: IntArray, fan: IntArray, first: int, last: int, begin: int, end: int) -> IntArray:
    """``turned_corridor`` from its face ``begin`` to before its face ``end``, as they are numbered before."""
    count = len(fan)
    turned = np.empty(first + 1 - begin + count + end - last, dtype=np.int32)
    for index in range(begin, first + 1):
        turned[index - begin] = corridor[index]
    for index in range(count):
        turned[first + 1 - begin + index] = fan[index]
    for index in range(last, end):
        turned[first + 1 - begin + count + index - last] = corridor[index]
    return turned


@inner_array_kernel
def pull_turned(
    mesh: FreeFaces, corridor: IntArray, points: FloatArray, marks: IntArray, fan: IntArray, first: int, last: int
) -> tuple[int, int, FloatArray, IntArray]:
    """Pull the part of a string that moves where its corridor is led over other faces between two of its faces.

    Parameters
    ----------
    corridor, points, marks
        As ``pull_string`` returns them.
    fan : (n,) int32
        The other faces.
    first, last : int
        Numbers of the two faces in the corridor.

    Returns
    -------
    low, high : int
        Rows of ``points`` between which it moves; beyond them it stays.
    pulled, pulled_marks : (m, 3) float64, (m,) int32
        What comes between them, these two included.
    """
    low, high = _bend_before(marks, Count(first + 1)), _bend_behind(marks, Count(last))
    while True:
        part = _part_with_fan(corridor, fan, first, last, low, high)
        ends = row(points, low), row(points, high)
        pulled, pulled_marks = pull_string(mesh.vertices, mesh.faces, part, ends[0], ends[1])
        begin, end = _group_before(marks, low), _group_behind(marks, high)
        bends_low = low == 0 or _bends(
            mesh, corridor, marks[low], begin - 1, low, row(points, begin - 1), row(pulled, Count(1))
        )
        bends_high = high == len(corridor) or _bends(
            mesh, corridor, marks[high], high - 1, end, row(pulled, Count(len(pulled) - 2)), row(points, end + 1)
        )
        if bends_low and bends_high:
            pulled_marks[0], pulled_marks[len(pulled) - 1] = marks[low], marks[high]
            return low, high, pulled, pulled_marks
        if not bends_low:
            low = _bend_before(marks, begin)
        if not bends_high:
            high = _bend_behind(marks, end)


@inner_kernel
def _bend_before(marks: IntArray, index: int) -> int:
    """The last row before one where the path goes through another vertex than there; 0, the start, without one."""
    before = index - 1
    while before > 0 and (marks[before] < 0 or marks[before] == marks[index]):
        before -= 1
    return before


@inner_kernel
def _bend_behind(marks: IntArray, index: int) -> int:
    """The first row behind one where the path goes through another vertex than there; the goal without one."""
    behind = index + 1
    while behind < len(marks) - 1 and (marks[behind] < 0 or marks[behind] == marks[index]):
        behind += 1
    return behind


@inner_kernel
def _group_before(marks: IntArray, index: int) -> int:
    """The first of the rows up to one that are all at its vertex."""
    while index > 1 and marks[index - 1] == marks[index]:
        index -= 1
    return index


@inner_kernel
def _group_behind(marks: IntArray, index: int) -> int:
    """The last of the rows from one on that are all at its vertex."""
    while index < len(marks) - 2 and marks[index + 1] == marks[index]:
        index += 1
    return index


@inner_kernel
def _bends(
    mesh: FreeFaces, corridor: IntArray, vertex: int, first: int, last: int, before: Vector, behind: Vector
) -> bool:
    """Whether a path bends round a vertex: the angle within faces ``first`` to ``last`` is half a turn or more.

    It comes from a point of the first of these faces of the corridor and goes to a point of the last one; all have the
    vertex as a corner.
    """
    at, total, begin = row(mesh.vertices, Count(vertex)), 0.0, before
    for index in range(first, last):
        end = row(mesh.vertices, _common_corner(mesh, corridor, index, vertex))
        total += angle_at(at, begin, end)
        begin = end
    return total + angle_at(at, begin, behind) >= _HALF_A_TURN


@inner_kernel
def _common_corner(mesh: FreeFaces, corridor: IntArray, index: int, vertex: int) -> int:
    """The other vertex that a face of the corridor and the next one have in common."""
    face, following = Count(corridor[index]), Count(corridor[index + 1])
    for corner in range(3):
        other = Count(mesh.faces[face, corner])
        if other != vertex and corner_of(mesh.faces[following], other) >= 0:
            return other  # type: ignore[no-any-return]
    return Count(vertex)  # type: ignore[no-any-return]


@inner_kernel
def angle_at(at: Vector, first: Vector, second: Vector) -> float:
    """Angle [rad] at a point between the directions to two others."""
    a, b = difference(first, at), difference(second, at)
    return math.acos(min(max(dot(a, b) / max(norm(a) * norm(b), 1e-300), -1.0), 1.0))


@inner_array_kernel
def spliced(
    points: FloatArray, marks: IntArray, pulled: FloatArray, pulled_marks: IntArray, low: int, high: int
) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and marks (n,) with those from row ``low`` to row ``high`` replaced by others."""
    count, shift = len(points), len(pulled) - 1 - high + low
    result = np.empty((count + shift, 3), dtype=np.float64)
    result_marks = np.empty(count + shift, dtype=np.int32)
    for index in range(low):
        result[index, 0], result[index, 1], result[index, 2] = points[index, 0], points[index, 1], points[index, 2]
        result_marks[index] = marks[index]
    for index in range(len(pulled)):
        set_row(result, Count(low + index), row(pulled, Count(index)))
        result_marks[low + index] = pulled_marks[index]
    for index in range(high + 1, count):
        set_row(result, Count(index + shift), row(points, Count(index)))
        result_marks[index + shift] = marks[index]
    return result, result_marks
