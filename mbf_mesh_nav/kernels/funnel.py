"""The shortest path within a strip of faces: unfold the strip into the plane and pull the string taut.

Funnel algorithm of Lee and Preparata (1984) in the form of Mononen's "simple stupid funnel": left and right side of the
funnel are narrowed portal by portal; where they cross, the string bends round a corner and a new funnel begins there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel
from mbf_mesh_nav.kernels.dijkstra import Int32Array

Float64Array = NDArray[np.float64]


@kernel
def pull_taut(
    vertices: Float64Array, faces: Int32Array, strip: Int32Array, start: Float64Array, goal: Float64Array
) -> Float64Array:
    """Shortest path through a strip of faces.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 [m], (F, 3) int32
    strip : (n,) int32
        Faces, each sharing an edge with the next.
    start, goal : (3,) float64
        Points in the first and the last face [m].

    Returns
    -------
    (n + 1, 3) float64
        Start, one point on each crossed edge, goal.
    """
    portal_count = len(strip) - 1
    left_ids, right_ids = np.empty(portal_count, np.int32), np.empty(portal_count, np.int32)
    left, right = np.empty((portal_count + 1, 2)), np.empty((portal_count + 1, 2))
    origin, target = _unfold(vertices, faces, strip, start, goal, left_ids, right_ids, left, right)
    left[portal_count], right[portal_count] = target, target  # the goal is the last portal, of no width

    bends = np.empty((portal_count + 2, 2))
    bend_portals = np.empty(portal_count + 2, np.int64)
    bends[0], bend_portals[0] = origin, -1
    bend_count = 1
    apex = origin
    left_end, right_end = left[0].copy(), right[0].copy()
    left_portal, right_portal = 0, 0
    index = 1
    while index <= portal_count:
        # 1. Narrow the right side unless it would cross the left one: then the string bends at the left end.
        crossed_left = False
        if _turn(apex, right_end, right[index]) >= 0.0:
            if _same(apex, right_end) or _turn(apex, left_end, right[index]) < 0.0:
                right_end, right_portal = right[index].copy(), index
            else:
                crossed_left = True
        # 2. The same for the left side.
        crossed_right = False
        if not crossed_left and _turn(apex, left_end, left[index]) <= 0.0:
            if _same(apex, left_end) or _turn(apex, right_end, left[index]) > 0.0:
                left_end, left_portal = left[index].copy(), index
            else:
                crossed_right = True
        # 3. A new funnel begins behind the bend.
        if crossed_left or crossed_right:
            apex = left_end.copy() if crossed_left else right_end.copy()
            index = left_portal if crossed_left else right_portal
            if _same(apex, bends[bend_count - 1]):  # still round the same corner
                bend_count -= 1
            bends[bend_count], bend_portals[bend_count] = apex, index
            bend_count += 1
            left_end, right_end = apex.copy(), apex.copy()
            left_portal, right_portal = index, index
        index += 1
    bends[bend_count], bend_portals[bend_count] = target, portal_count
    return _crossings(vertices, left_ids, right_ids, left, right, bends[: bend_count + 1], bend_portals, start, goal)


@kernel
def _unfold(
    vertices: Float64Array,
    faces: Int32Array,
    strip: Int32Array,
    start: Float64Array,
    goal: Float64Array,
    left_ids: Int32Array,
    right_ids: Int32Array,
    left: Float64Array,
    right: Float64Array,
) -> tuple[Float64Array, Float64Array]:
    """Lay the strip into the plane; fills the portals' vertices and ends, returns start and goal in the plane."""
    first = faces[strip[0]]
    a, b = first[0], first[1]
    flat_a = np.zeros(2)
    flat_b = np.array([math.sqrt(np.sum((vertices[b] - vertices[a]) ** 2)), 0.0])
    c = first[2]
    flat_c = _placed(vertices, a, b, flat_a, flat_b, vertices[c], 1.0)
    flat_start = _placed(vertices, a, b, flat_a, flat_b, start, 1.0)
    for i in range(len(strip) - 1):
        # The corner of this face that the next one does not have; the edge opposite to it is the portal.
        following = faces[strip[i + 1]]
        while c == following[0] or c == following[1] or c == following[2]:
            a, b, c = b, c, a
            flat_a, flat_b, flat_c = flat_b, flat_c, flat_a
        # (a, b, c) is counter-clockwise, so looking out over a->b the left end is b.
        left_ids[i], right_ids[i] = b, a
        left[i], right[i] = flat_b, flat_a
        apex = following[0] + following[1] + following[2] - a - b
        flat_apex = _placed(vertices, a, b, flat_a, flat_b, vertices[apex], -1.0)
        # The next face, counter-clockwise, is (b, a, apex).
        a, b, c = b, a, apex
        flat_a, flat_b, flat_c = flat_b, flat_a, flat_apex
    return flat_start, _placed(vertices, a, b, flat_a, flat_b, goal, 1.0)


@kernel
def _placed(
    vertices: Float64Array, a: int, b: int, flat_a: Float64Array, flat_b: Float64Array, point: Float64Array, side: float
) -> Float64Array:
    """Place a point in the plane, left (+1) or right (-1) of the edge a->b, keeping its distances to both ends."""
    edge = vertices[b] - vertices[a]
    length = math.sqrt(np.sum(edge * edge))
    offset = point - vertices[a]
    along = np.sum(offset * edge) / length
    height = math.sqrt(max(np.sum(offset * offset) - along * along, 0.0))
    ux, uy = (flat_b[0] - flat_a[0]) / length, (flat_b[1] - flat_a[1]) / length
    return np.array([flat_a[0] + along * ux - side * height * uy, flat_a[1] + along * uy + side * height * ux])


@kernel
def _turn(origin: Float64Array, first: Float64Array, second: Float64Array) -> float:
    """Positive if ``second`` lies to the left of the ray from ``origin`` through ``first``."""
    ax, ay = first[0] - origin[0], first[1] - origin[1]
    bx, by = second[0] - origin[0], second[1] - origin[1]
    return float(ax * by - ay * bx)


@kernel
def _same(first: Float64Array, second: Float64Array) -> bool:
    return bool(abs(first[0] - second[0]) + abs(first[1] - second[1]) < 1e-12)


@kernel
def _crossings(
    vertices: Float64Array,
    left_ids: Int32Array,
    right_ids: Int32Array,
    left: Float64Array,
    right: Float64Array,
    bends: Float64Array,
    bend_portals: NDArray[np.int64],
    start: Float64Array,
    goal: Float64Array,
) -> Float64Array:
    """Points on the surface where the taut string crosses the portals, between start and goal."""
    portal_count = len(left_ids)
    points = np.empty((portal_count + 2, 3))
    points[0], points[portal_count + 1] = start, goal
    segment = 0
    for i in range(portal_count):
        while segment + 2 < len(bends) and bend_portals[segment + 1] < i:
            segment += 1
        a, b = bends[segment], bends[segment + 1]
        from_right, from_left = _turn(a, b, right[i]), _turn(a, b, left[i])
        spread = from_right - from_left
        if abs(spread) < 1e-12:  # the string runs along the portal: take the end it comes to first
            share = 0.0 if np.sum((right[i] - a) ** 2) < np.sum((left[i] - a) ** 2) else 1.0
        else:
            share = min(max(from_right / spread, 0.0), 1.0)
        points[i + 1] = vertices[right_ids[i]] + share * (vertices[left_ids[i]] - vertices[right_ids[i]])
    return points
