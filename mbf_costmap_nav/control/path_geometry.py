"""Plane geometry of polylines: closest point, resampling, look-ahead point. Pure functions over (n, 2) points [m]."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry.arithmetic import scalar_products

FloatArray = NDArray[np.float64]


def arc_lengths(points: FloatArray) -> FloatArray:
    """(n,) length [m] along the polyline from its first point to each point."""
    if len(points) == 0:
        return np.zeros(0)
    steps = np.hypot(*np.diff(points, axis=0).T) if len(points) > 1 else np.zeros(0)
    return np.concatenate([[0.0], np.cumsum(steps)])


def closest_point(
    points: FloatArray, position: ArrayLike, first: int = 0, last: int | None = None
) -> tuple[int, float]:
    """Find the point of a polyline that is nearest to ``position``.

    Parameters
    ----------
    points : (n, 2) float64
        At least one point.
    position : (2,) float
    first, last : int
        Only the segments ``first`` .. ``last - 1`` are looked at (all by default).

    Returns
    -------
    segment : int
        The nearest segment, the earliest of equals.
    fraction : float
        Where on it, 0 at its start, 1 at its end.

    Raises
    ------
    IndexError
        ``first`` is no point of the polyline.
    """
    if not 0 <= first < len(points):
        raise IndexError(f"start index {first} is outside a path of {len(points)} poses")
    last = len(points) - 1 if last is None else min(last, len(points) - 1)
    if last <= first:
        return first, 0.0
    starts, sides = points[first:last], np.diff(points[first : last + 1], axis=0)
    offset = np.asarray(position, dtype=np.float64) - starts
    fractions = np.clip(np.sum(offset * sides, axis=1) / np.maximum(np.sum(sides**2, axis=1), 1e-12), 0.0, 1.0)
    distances = np.hypot(*(offset - fractions[:, None] * sides).T)
    best = int(np.argmin(distances))
    return first + best, float(fractions[best])


def distance_to_path(points: FloatArray, position: ArrayLike, first: int = 0) -> float:
    """Distance [m] from ``position`` to the polyline from point ``first`` on; inf for a path without points."""
    if len(points) == 0:
        return math.inf
    segment, fraction = closest_point(points, position, first)
    following = points[min(segment + 1, len(points) - 1)]
    nearest = points[segment] + fraction * (following - points[segment])
    return float(np.hypot(*(np.asarray(position) - nearest)))


def resample(points: FloatArray, spacing: float) -> FloatArray:
    """Insert points so that no segment is longer than ``spacing`` [m]; all given points are kept."""
    if len(points) < 2:
        return points.copy()
    pieces = []
    for a, b in pairwise(points):
        count = max(1, math.ceil(math.dist(a, b) / spacing - 1e-9))
        pieces.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.concatenate([*pieces, points[-1:]])


def circle_crossing(a: ArrayLike, b: ArrayLike, radius: float) -> FloatArray:
    """Point where the segment from ``a`` to ``b`` crosses the circle of ``radius`` [m] around the origin.

    One end must lie inside (or on) the circle and the other outside (or on) it; the crossing is then unique, but for a
    segment that starts on the circle and runs through it: of two the one nearer to ``b`` is returned.
    """
    start, side = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64) - np.asarray(a, dtype=np.float64)
    quadratic = float(scalar_products(side, side))
    linear = float(scalar_products(start, side))
    constant = float(scalar_products(start, start)) - radius * radius
    root = math.sqrt(max(0.0, linear * linear - quadratic * constant))
    far, near = (-linear + root) / quadratic, (-linear - root) / quadratic
    return np.asarray(start + side * (far if -1e-12 <= far <= 1.0 + 1e-12 else near))


def look_ahead_point(points: FloatArray, distance: float, extrapolate: bool = False) -> FloatArray:
    """Point of a path, given in the robot's frame, at ``distance`` [m] from the robot (the carrot).

    Parameters
    ----------
    points : (n, 2) float64
        At least one point; the robot is the origin.
    distance : float
        Radius of the circle around the robot.
    extrapolate : bool
        If the whole path lies inside the circle, go on straight from its end until ``distance`` is reached along the
        path from its first point; otherwise the last point is returned.
    """
    beyond = np.flatnonzero(np.hypot(*points.T) >= distance)
    if beyond.size and beyond[0] == 0:
        return np.asarray(points[0])
    if beyond.size:
        return circle_crossing(points[beyond[0] - 1], points[beyond[0]], distance)
    length = arc_lengths(points)[-1]
    if not extrapolate or len(points) < 2 or length >= distance:
        return np.asarray(points[-1])
    direction = points[-1] - points[-2]
    return np.asarray(points[-1] + (distance - length) * direction / np.hypot(*direction))
