"""Penetration depth of a convex outline in walls and other things: the shortest motion that frees it, in metres.

Separating axes: two convex shapes are apart if and only if their projections on some edge normal are; else the
narrowest overlap of the projections is the depth (Ericson, Real-Time Collision Detection, 2005, 4.4). A negative
depth means that the shapes are apart by at least its magnitude.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import plane_rotation, rotated


def placed(corners: FloatArray, x: float, y: float, yaw: float) -> FloatArray:
    """Corners (n, 2) [m] of an outline in the map, its base at (x, y) with heading ``yaw``."""
    return np.asarray(rotated(plane_rotation(yaw), corners) + np.array([x, y]))


def depth_in_polygon(corners: FloatArray, other: FloatArray) -> float:
    """Penetration depth [m] of the convex outlines (n, 2) and (m, 2), counter-clockwise."""
    depth = math.inf
    for nx, ny in (*_normals(corners), *_normals(other)):
        ours, theirs = corners[:, 0] * nx + corners[:, 1] * ny, other[:, 0] * nx + other[:, 1] * ny
        depth = min(depth, float(ours.max() - theirs.min()), float(theirs.max() - ours.min()))
    return depth


def gap_to_polygon(corners: FloatArray, other: FloatArray) -> float:
    """Distance [m] between the convex outlines (n, 2) and (m, 2), counter-clockwise; 0 where they overlap.

    Where they are apart, it lies between a corner of one and an edge of the other.
    """
    if depth_in_polygon(corners, other) >= 0.0:
        return 0.0
    ours, theirs = corners.tolist(), other.tolist()
    return min(
        _distance_to_piece(x, y, a, b)
        for points, outline in ((ours, theirs), (theirs, ours))
        for x, y in points
        for a, b in zip(outline, [*outline[1:], outline[0]], strict=True)
    )


def depth_in_circle(corners: FloatArray, x: float, y: float, radius: float) -> float:
    """Penetration depth [m] of a convex outline (n, 2), counter-clockwise, and a circle."""
    ahead = np.roll(corners, -1, axis=0)
    normals = _normals(corners)
    outside: float = max((x - a[0]) * n[0] + (y - a[1]) * n[1] for a, n in zip(corners.tolist(), normals, strict=True))
    if outside <= 0.0:
        return radius - outside
    nearest = min(_distance_to_piece(x, y, a, b) for a, b in zip(corners.tolist(), ahead.tolist(), strict=True))
    return radius - nearest


def depth_in_cells(corners: FloatArray, occupied: NDArray[np.bool_], resolution: float, origin: FloatArray) -> float:
    """Penetration depth [m] of a convex outline (n, 2), counter-clockwise, in occupied cells; -inf far from all.

    Parameters
    ----------
    occupied : (ny, nx) bool
    resolution : float
        Cell size [m].
    origin : (2,) float
        Lower left corner of cell [0, 0] [m].
    """
    ny, nx = occupied.shape
    low = np.floor((corners.min(axis=0) - origin) / resolution).astype(int) - 1
    high = np.floor((corners.max(axis=0) - origin) / resolution).astype(int) + 2
    x_low, y_low, x_high, y_high = max(0, low[0]), max(0, low[1]), min(nx, high[0]), min(ny, high[1])
    if x_low >= x_high or y_low >= y_high:
        return -math.inf
    iy, ix = np.nonzero(occupied[y_low:y_high, x_low:x_high])
    x = origin[0] + (ix + x_low + 0.5) * resolution
    y = origin[1] + (iy + y_low + 0.5) * resolution
    depths = np.full(len(x), math.inf)
    for ax, ay in ((1.0, 0.0), (0.0, 1.0), *_normals(corners)):
        half = 0.5 * resolution * (abs(ax) + abs(ay))
        projected, middles = corners[:, 0] * ax + corners[:, 1] * ay, x * ax + y * ay
        depths = np.minimum(depths, np.minimum(projected.max() - middles, middles - projected.min()) + half)
    return float(depths.max(initial=-math.inf))


def _normals(corners: FloatArray) -> list[tuple[float, float]]:
    """Unit outward normals of the edges of a counter-clockwise outline, edge i from corner i to the next."""
    points = corners.tolist()
    normals = []
    for (ax, ay), (bx, by) in zip(points, [*points[1:], points[0]], strict=True):
        length = math.hypot(bx - ax, by - ay)
        normals.append(((by - ay) / length, (ax - bx) / length))
    return normals


def _distance_to_piece(x: float, y: float, a: list[float], b: list[float]) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = max(0.0, min(1.0, ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)))
    return math.hypot(x - a[0] - along * dx, y - a[1] - along * dy)
