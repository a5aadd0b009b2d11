"""The shortest path within a corridor of faces: string pulling by the funnel algorithm.

Funnel algorithm of Lee and Preparata (1984) in the form of Mononen's "simple stupid funnel": left and right side of the
funnel are narrowed portal by portal; where they cross, the string bends round a corner and a new funnel begins there.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel, plain_kernel
from mbf_mesh_nav.kernels.mesh.vectors import Vector, between, difference, dot, norm, row, set_row

_AT_VERTEX = 1e-7  # m; a crossing this near to the end of a portal is that vertex
_NEAR_END = 1e-3  # share of a portal; farther from its ends no crossing is one of them

FlatPoint = tuple[float, float]
"""A point of the unfolded corridor."""


@kernel
def pull_string(
    vertices: FloatArray, faces: IntArray, corridor: IntArray, start: Vector, goal: Vector
) -> tuple[FloatArray, IntArray]:
    """Shortest path through a corridor of faces, and where it touches vertices.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (F, 3) int32
    corridor : (n,) int32
        Faces, each sharing an edge with the next.
    start, goal : (float, float, float)
        Points in the first and the last face [m].

    Returns
    -------
    points : (n + 1, 3) float64
        Start, one point on each crossed edge, goal [m].
    marks : (n + 1,) int32
        The vertex that each of the points is; -1 where it is none. Start and goal, which lie anywhere, are none.
    """
    portal_count = len(corridor) - 1
    portals = np.empty((portal_count, 2), dtype=np.int32)  # vertices at the left and right end
    flat_portals = np.empty((portal_count + 1, 4), dtype=np.float64)  # left x y, right x y
    apex, target = _unfold(vertices, faces, corridor, start, goal, portals, flat_portals)
    _set_portal(flat_portals, portal_count, target, target)  # the goal is the last portal, of no width

    bends = np.empty((portal_count + 2, 2), dtype=np.float64)
    bend_portals = np.empty(portal_count + 2, dtype=np.int32)
    bends[0, 0], bends[0, 1], bend_portals[0] = apex[0], apex[1], -1
    bend_count = 1
    left_end, right_end = _left(flat_portals, Count(0)), _right(flat_portals, Count(0))
    left_portal, right_portal = 0, 0
    index = Count(1)
    while index <= portal_count:
        left, right = _left(flat_portals, index), _right(flat_portals, index)
        # 1. Narrow the right side unless it would cross the left one: then the string bends at the left end.
        crossed_left = False
        if _turn(apex, right_end, right) >= 0.0:
            if _same(apex, right_end) or _turn(apex, left_end, right) < 0.0:
                right_end, right_portal = right, index
            else:
                crossed_left = True
        # 2. The same for the left side.
        crossed_right = False
        if not crossed_left and _turn(apex, left_end, left) <= 0.0:
            if _same(apex, left_end) or _turn(apex, right_end, left) > 0.0:
                left_end, left_portal = left, index
            else:
                crossed_right = True
        # 3. A new funnel begins behind the bend.
        if crossed_left or crossed_right:
            apex = left_end if crossed_left else right_end
            index = left_portal if crossed_left else right_portal
            if _same(apex, (bends[bend_count - 1, 0], bends[bend_count - 1, 1])):  # still round the same corner
                bend_count -= 1
            bends[bend_count, 0], bends[bend_count, 1], bend_portals[bend_count] = apex[0], apex[1], index
            bend_count += 1
            left_end, right_end = apex, apex
            left_portal, right_portal = index, index
        index += 1
    bends[bend_count, 0], bends[bend_count, 1], bend_portals[bend_count] = target[0], target[1], portal_count
    points, marks = np.empty((portal_count + 2, 3), dtype=np.float64), np.empty(portal_count + 2, dtype=np.int32)
    set_row(points, Count(0), start)
    set_row(points, Count(portal_count + 1), goal)
    marks[0] = marks[portal_count + 1] = -1
    _cross_portals(vertices, portals, flat_portals, bends, bend_portals, bend_count, points, marks)
    return points, marks


@inner_kernel
def _unfold(
    vertices: FloatArray,
    faces: IntArray,
    corridor: IntArray,
    start: Vector,
    goal: Vector,
    portals: IntArray,
    flat_portals: FloatArray,
) -> tuple[FlatPoint, FlatPoint]:
    """Lay the corridor into the plane; fills the portals' vertices and ends, returns start and goal in the plane."""
    a, b, c = Count(faces[corridor[0], 0]), Count(faces[corridor[0], 1]), Count(faces[corridor[0], 2])
    edge = difference(row(vertices, b), row(vertices, a))
    flat_a, flat_b = (0.0, 0.0), (math.sqrt(dot(edge, edge)), 0.0)
    flat_c = _placed(vertices, a, b, flat_a, flat_b, row(vertices, c), 1.0)
    flat_start = _placed(vertices, a, b, flat_a, flat_b, start, 1.0)
    for i in range(len(corridor) - 1):
        # The corner of this face that the next one does not have; the edge opposite to it is the portal.
        following = faces[corridor[i + 1]]
        while c == following[0] or c == following[1] or c == following[2]:
            a, b, c = b, c, a
            flat_a, flat_b, flat_c = flat_b, flat_c, flat_a
        # (a, b, c) is counter-clockwise, so looking out over a->b the left end is b.
        portals[i, 0], portals[i, 1] = b, a
        _set_portal(flat_portals, Count(i), flat_b, flat_a)
        apex = Count(following[0]) + following[1] + following[2] - a - b
        flat_apex = _placed(vertices, a, b, flat_a, flat_b, row(vertices, apex), -1.0)
        # The next face, counter-clockwise, is (b, a, apex).
        a, b, c = b, a, apex
        flat_a, flat_b, flat_c = flat_b, flat_a, flat_apex
    return flat_start, _placed(vertices, a, b, flat_a, flat_b, goal, 1.0)


@inner_kernel
def _placed(
    vertices: FloatArray, a: int, b: int, flat_a: FlatPoint, flat_b: FlatPoint, point: Vector, side: float
) -> FlatPoint:
    """Place a point in the plane, left (+1) or right (-1) of the edge a->b, keeping its distances to both ends."""
    edge = difference(row(vertices, b), row(vertices, a))
    length = math.sqrt(dot(edge, edge))
    offset = difference(point, row(vertices, a))
    along = dot(offset, edge) / length
    height = math.sqrt(max(dot(offset, offset) - along * along, 0.0))
    ux, uy = (flat_b[0] - flat_a[0]) / length, (flat_b[1] - flat_a[1]) / length
    return flat_a[0] + along * ux - side * height * uy, flat_a[1] + along * uy + side * height * ux


@plain_kernel
def _left(flat_portals: FloatArray, index: int) -> FlatPoint:
    return flat_portals[index, 0], flat_portals[index, 1]


@inner_kernel
def _right(flat_portals: FloatArray, index: int) -> FlatPoint:
    return flat_portals[index, 2], flat_portals[index, 3]


@inner_kernel
def _set_portal(flat_portals: FloatArray, index: int, left: FlatPoint, right: FlatPoint) -> None:
    flat_portals[index, 0], flat_portals[index, 1] = left
    flat_portals[index, 2], flat_portals[index, 3] = right


@inner_kernel
def _turn(origin: FlatPoint, first: FlatPoint, second: FlatPoint) -> float:
    """Positive if ``second`` lies to the left of the ray from ``origin`` through ``first``."""
    ax, ay = first[0] - origin[0], first[1] - origin[1]
    bx, by = second[0] - origin[0], second[1] - origin[1]
    return ax * by - ay * bx


@inner_kernel
def _same(first: FlatPoint, second: FlatPoint) -> bool:
    return abs(first[0] - second[0]) + abs(first[1] - second[1]) < 1e-12


@inner_kernel
def _cross_portals(
    vertices: FloatArray,
    portals: IntArray,
    flat_portals: FloatArray,
    bends: FloatArray,
    bend_portals: IntArray,
    last_bend: int,
    points: FloatArray,
    marks: IntArray,
) -> None:
    """Write the points where the string, straight between its bends, crosses the portals; portal i to row i + 1.

    Their marks are the vertices that they are.
    """
    segment = 0
    for i in range(len(portals)):
        while segment + 1 < last_bend and bend_portals[segment + 1] < i:
            segment += 1
        a, b = (bends[segment, 0], bends[segment, 1]), (bends[segment + 1, 0], bends[segment + 1, 1])
        left, right = _left(flat_portals, i), _right(flat_portals, i)
        from_right, from_left = _turn(a, b, right), _turn(a, b, left)
        spread = from_right - from_left
        if abs(spread) < 1e-12:  # the string runs along the portal: take the end it comes to first
            to_right, to_left = (right[0] - a[0], right[1] - a[1]), (left[0] - a[0], left[1] - a[1])
            right_first = math.hypot(to_right[0], to_right[1]) < math.hypot(to_left[0], to_left[1])
            share = 0.0 if right_first else 1.0
        else:
            share = min(max(from_right / spread, 0.0), 1.0)
        crossing = between(row(vertices, Count(portals[i, 1])), row(vertices, Count(portals[i, 0])), share)
        set_row(points, Count(i + 1), crossing)
        marks[i + 1] = -1
        if share < _NEAR_END or share > 1.0 - _NEAR_END:
            end = Count(portals[i, 1] if share < _NEAR_END else portals[i, 0])
            if norm(difference(row(vertices, end), crossing)) < _AT_VERTEX:
                marks[i + 1] = end
