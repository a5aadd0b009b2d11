"""Steps of a manoeuvre: where they lead from a pose, and how far their ends are from points."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import brief_kernel

FloatArray = NDArray[np.float64]


@brief_kernel
def steps_from(x: float, y: float, yaw: float, steps: FloatArray) -> FloatArray:
    """Poses (k, m, 3) of steps that begin at a pose x, y [m], yaw [rad]; ``steps`` (k, m, 3) begin at the origin."""
    c, s = math.cos(yaw), math.sin(yaw)
    moved = np.empty_like(steps)
    for i in range(steps.shape[0]):
        for j in range(steps.shape[1]):
            ahead, left = steps[i, j, 0], steps[i, j, 1]
            moved[i, j, 0] = x + c * ahead - s * left
            moved[i, j, 1] = y + s * ahead + c * left
            moved[i, j, 2] = yaw + steps[i, j, 2]
    return moved


@brief_kernel
def distances_from_points(points: FloatArray, poses: FloatArray) -> FloatArray:
    """Distance (k,) [m] of each of the poses (k, 3) from the nearest of the points (n, 2); inf without a point."""
    distances = np.empty(len(poses))
    for i in range(len(poses)):
        least = np.inf
        for j in range(len(points)):
            dx, dy = points[j, 0] - poses[i, 0], points[j, 1] - poses[i, 1]
            least = min(least, dx * dx + dy * dy)
        distances[i] = math.sqrt(least)
    return distances
