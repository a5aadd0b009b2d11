"""Arcs: the one that leads the robot through a point (pure pursuit), and the poses along the one of a velocity."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import rotated_back
from mbf_abstract.geometry.pose import Pose

FloatArray = NDArray[np.float64]


def in_robot_frame(pose: Pose, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates (3,) of a global point in the robot's frame: x ahead, y left, both in its tangent plane."""
    return rotated_back(pose.rotation, point - np.asarray(pose.position))


def arc_to(pose: Pose, point: NDArray[np.float64]) -> tuple[float, float]:
    """Bearing [rad] of a point, and curvature [1/m] of the arc tangent to the robot's heading through it (left > 0)."""
    x, y, _ = in_robot_frame(pose, point)
    return math.atan2(y, x), 2.0 * float(y) / max(float(x * x + y * y), 1e-6)


def arc_poses(
    pose: tuple[float, float, float], vx: float, vy: float, wz: float, duration: float, step: float
) -> FloatArray:
    """Poses (n, 3) of a body that keeps a velocity, every ``step`` [s] up to ``duration``, the start left out.

    Exact integration of a constant twist (vx, vy [m/s], wz [rad/s]).
    """
    x, y, yaw = pose
    times = np.append(np.arange(step, duration, step), duration)
    angles = wz * times
    # integral of the rotation over time: sin(a)/w and (1 - cos(a))/w, stable where w vanishes
    sine = times * np.sinc(angles / np.pi)
    versine = times * np.sinc(angles / (2.0 * np.pi)) * np.sin(angles / 2.0)
    forward, left = vx * sine - vy * versine, vx * versine + vy * sine
    c, s = math.cos(yaw), math.sin(yaw)
    return np.column_stack([x + c * forward - s * left, y + s * forward + c * left, yaw + angles])
