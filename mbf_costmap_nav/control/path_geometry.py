"""Plane geometry of polylines: resampling and the look-ahead point. Pure functions over (n, 2) points [m]."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def resample(points: FloatArray, spacing: float) -> FloatArray:
    """Insert points into points (n, 2) or (n, 3) [m] so that no segment is longer than ``spacing`` [m]; they stay."""
    if len(points) < 2:
        return points.copy()
    pieces = []
    for a, b in pairwise(points):
        count = max(1, math.ceil(math.dist(a, b) / spacing - 1e-9))
        pieces.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.concatenate([*pieces, points[-1:]])


def circle_crossing(a: Sequence[float] | FloatArray, b: Sequence[float] | FloatArray, radius: float) -> FloatArray:
    """Point (2,) [m] where the segment from ``a`` to ``b`` crosses the circle of ``radius`` [m] around the origin.

    One end must lie inside (or on) the circle and the other outside (or on) it; the crossing is then unique, but for a
    segment that starts on the circle and runs through it: of two the one nearer to ``b`` is returned.
    """
    (x, y), (end_x, end_y) = (float(c) for c in a), (float(c) for c in b)  # plain numbers: once a control cycle
    dx, dy = end_x - x, end_y - y
    quadratic, linear, constant = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - radius * radius
    root = math.sqrt(max(0.0, linear * linear - quadratic * constant))
    far, near = (-linear + root) / quadratic, (-linear - root) / quadratic
    share = far if -1e-12 <= far <= 1.0 + 1e-12 else near
    return np.array([x + dx * share, y + dy * share])


def look_ahead_point(points: FloatArray, distance: float) -> FloatArray:
    """Point of a path, given in the robot's frame, at ``distance`` [m] from the robot (the carrot).

    Parameters
    ----------
    points : (n, 2) float64
        At least one point; the robot is the origin.
    distance : float
        Radius of the circle around the robot; the last point is returned if the whole path lies inside it.
    """
    beyond = np.flatnonzero(np.hypot(*points.T) >= distance)
    if beyond.size == 0:
        return np.asarray(points[-1])
    if beyond[0] == 0:
        return np.asarray(points[0])
    return circle_crossing(points[beyond[0] - 1], points[beyond[0]], distance)
