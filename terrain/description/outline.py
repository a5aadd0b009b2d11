"""Convex outlines in the plane: the hull of points, and a polygon of few corners around it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mbf_abstract.geometry import FloatArray

Corner = tuple[float, float]
SAME = 1e-6  # m; points nearer than this to a straight edge are no corners
HUGE = 30.0  # m; no robot is longer
PARALLEL = 1e-9  # cosine between a direction and the normal of an edge along it


def convex_outline(points: FloatArray) -> list[Corner]:
    """Corners [m] of the hull of points (n, 2), counter-clockwise (monotone chain, Andrew 1979)."""
    ordered = sorted({(round(x, 12), round(y, 12)) for x, y in points[:, :2].tolist()})
    if len(ordered) < 3:
        return ordered
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return lower[:-1] + upper[:-1]


def _chain(points: list[Corner]) -> list[Corner]:
    chain: list[Corner] = []
    for point in points:
        while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= SAME:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a: Corner, b: Corner, c: Corner) -> float:
    """Distance [m] of ``c`` to the left of the line from ``a`` to ``b``."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = math.hypot(dx, dy)
    return (dx * (c[1] - a[1]) - dy * (c[0] - a[0])) / length if length > 0.0 else 0.0


def with_few_corners(outline: list[Corner], most: int) -> list[Corner]:
    """A convex polygon of at most ``most`` corners around a convex one, both counter-clockwise.

    The edge goes whose neighbours, made longer until they meet, add the least area; so nothing sticks out.
    """
    corners = list(outline)
    while len(corners) > max(4, most):
        options = [(_apex(corners, k), k) for k in range(len(corners))]
        added = [(apex[1], k, apex[0]) for apex, k in options if apex is not None]
        if not added:
            return corners
        _, k, meeting = min(added)
        following = (k + 1) % len(corners)
        corners[k] = meeting
        del corners[following]
    return corners


def _apex(corners: list[Corner], k: int) -> tuple[Corner, float] | None:
    """Where the neighbours of the edge from corner ``k`` meet, and the area [m2] that this adds."""
    count = len(corners)
    a, b, c, d = (corners[(k + offset) % count] for offset in (-1, 0, 1, 2))
    (ux, uy), (vx, vy) = (b[0] - a[0], b[1] - a[1]), (c[0] - d[0], c[1] - d[1])
    crossing = ux * vy - uy * vx
    if crossing >= -1e-9:  # parallel, or they part: they meet on the other side
        return None
    along = ((c[0] - b[0]) * vy - (c[1] - b[1]) * vx) / crossing
    x, y = b[0] + along * ux, b[1] + along * uy
    area = 0.5 * abs((c[0] - b[0]) * (y - b[1]) - (c[1] - b[1]) * (x - b[0]))
    return (x, y), area


def note_on_its_size(outline: list[Corner]) -> str:
    """Say that a robot is as large as if its file were in millimetres, else ""; an outline of two or more corners."""
    xs, ys = zip(*outline, strict=True)
    size = max(max(xs) - min(xs), max(ys) - min(ys))
    if size < HUGE:
        return ""
    return f"its footprint is {size:.0f} m long; a URDF is in metres, and this looks like millimetres"


def reach(outline: list[Corner], point: Corner, direction: Corner) -> float:
    """Distance [m] from a point inside a convex outline to its boundary along the unit vector ``direction``.

    Below 0 where the point is outside: how far it would have to go back.
    """
    nearest = math.inf
    for a, b in zip(outline, [*outline[1:], outline[0]], strict=True):
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        nx, ny = (b[1] - a[1]) / length, (a[0] - b[0]) / length
        towards = nx * direction[0] + ny * direction[1]
        gap = nx * (a[0] - point[0]) + ny * (a[1] - point[1])
        if towards > PARALLEL:
            nearest = min(nearest, gap / towards)
        elif gap < 0.0 and towards > -PARALLEL:
            return -math.inf
    return nearest


def edge_distance(outline: list[Corner], point: Corner) -> float:
    """Least distance [m] of a point to the edges of a convex outline around it; below 0 outside."""
    return min(_turn(a, b, point) for a, b in zip(outline, [*outline[1:], outline[0]], strict=True))


def as_array(outline: list[Corner]) -> FloatArray:
    """Corners as (n, 2) float64 [m]."""
    return np.array(outline, dtype=np.float64).reshape(-1, 2)


def surrounds_base(outline: Sequence[Corner]) -> bool:
    """Whether ``base_link`` lies in a convex outline, counter-clockwise, or on a side of it."""
    ends = [*outline[1:], outline[0]]
    return all(ax * by - ay * bx >= 0.0 for (ax, ay), (bx, by) in zip(outline, ends, strict=True))


def footprint_radii(footprint: list[Corner]) -> tuple[float, float]:
    """Radii [m] of the largest circle about ``base_link`` inside an outline, and of the smallest one around it."""
    corners = as_array(footprint)
    outer = max(math.hypot(x, y) for x, y in corners.tolist())
    inner = math.inf
    for (ax, ay), (bx, by) in zip(footprint, [*footprint[1:], footprint[0]], strict=True):
        inner = min(inner, (ax * by - ay * bx) / math.hypot(bx - ax, by - ay))
    return max(0.0, inner), outer
