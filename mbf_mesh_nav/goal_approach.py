"""What controllers on meshes share about arriving: heading errors in the tangent plane and the goal test."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose


def in_robot_frame(pose: Pose, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates (3,) of a global point in the robot's frame: x ahead, y left, both in its tangent plane."""
    return np.asarray(pose.rotation.T @ (point - np.asarray(pose.position)))


def heading_error(pose: Pose, other: Pose) -> float:
    """Angle [rad] in (-pi, pi] the robot has to turn left, about its own z axis, to look where ``other`` looks."""
    ahead = pose.rotation.T @ other.rotation[:, 0]
    return math.atan2(ahead[1], ahead[0])


def is_at_goal(pose: Pose, goal: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
    """Whether ``pose`` is within ``dist_tolerance`` [m] and its heading within ``angle_tolerance`` [rad] of the goal.

    Headings are compared in the robot's tangent plane, so a goal orientation given without the slope of the ground
    can be reached.
    """
    return pose.distance_to(goal) <= dist_tolerance and abs(heading_error(pose, goal)) <= angle_tolerance


def clamp(value: float, limit: float) -> float:
    """Limit a value symmetrically to [-limit, limit]."""
    return max(-limit, min(limit, value))


def braking_speed(distance: float, deceleration: float) -> float:
    """Speed [m/s] from which a constant ``deceleration`` [m/s^2] stops the robot after ``distance`` [m]."""
    return math.sqrt(2.0 * deceleration * max(distance, 0.0))
