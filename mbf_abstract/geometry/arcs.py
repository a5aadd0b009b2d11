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
    """Bearing [rad] of a point (3,) [m], and curvature [1/m] of the arc tangent to the heading to it (left > 0)."""
    x, y, _ = in_robot_frame(pose, point)
    return math.atan2(y, x), 2.0 * float(y) / max(float(x * x + y * y), 1e-6)


def arc_poses(
    pose: tuple[float, float, float], vx: float, vy: float, wz: float, duration: float, step: float
) -> FloatArray:
    """Poses (n, 3) of a body that keeps a velocity, every ``step`` [s] up to ``duration``, the start left out.

    Exact integration of a constant twist (vx, vy [m/s], wz [rad/s]).
    """
    return poses_on_arc(pose, vx, vy, wz, np.concatenate((np.arange(step, duration, step), (duration,))))


def poses_on_arc(pose: tuple[float, float, float], vx: float, vy: float, wz: float, times: FloatArray) -> FloatArray:
    """Poses (n, 3) of a body that keeps a velocity, after some ``times`` (n,) [s], 0 or more; see ``arc_poses``."""
    x, y, yaw = pose
    # Driven is an arc; its chord points half the turn away from the heading and is sin(half) / half times as long.
    half_turns = (0.5 * wz) * times
    turned = half_turns != 0.0
    chords = times * np.divide(np.sin(half_turns), half_turns, out=np.ones_like(half_turns), where=turned)
    c, s = np.cos(yaw + half_turns), np.sin(yaw + half_turns)
    return np.column_stack([x + chords * (vx * c - vy * s), y + chords * (vx * s + vy * c), yaw + wz * times])
