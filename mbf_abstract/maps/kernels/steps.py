"""Steps of a manoeuvre: where they lead from a pose, where that is on the map, how far their ends are from points."""

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
def positions_in_frame(
    poses: FloatArray, translation: tuple[float, float, float], rotation: tuple[float, float, float, float]
) -> FloatArray:
    """Positions (n, 3) [m] of poses (n, 3) in the plane of a frame, in its parent, as of ``Transform.apply_to_pose``.

    ``v + 2 u x (u x v + w v)`` with the rotation (u, w), as ``rotate`` has it.
    """
    ax, ay, az, aw = rotation
    positions = np.empty_like(poses)
    for i in range(len(poses)):
        x, y = poses[i, 0], poses[i, 1]
        cx, cy, cz = aw * x - az * y, az * x + aw * y, ax * y - ay * x
        positions[i, 0] = translation[0] + (x + 2.0 * (ay * cz - az * cy))
        positions[i, 1] = translation[1] + (y + 2.0 * (az * cx - ax * cz))
        positions[i, 2] = translation[2] + 2.0 * (ax * cy - ay * cx)
    return positions


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
