"""What controllers on meshes share about arriving: heading errors in the tangent plane and the goal test."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import rotated_back
from mbf_abstract.geometry import Pose

_SAME_STOREY = 0.5  # [m]


def in_robot_frame(pose: Pose, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates (3,) of a global point in the robot's frame: x ahead, y left, both in its tangent plane."""
    return rotated_back(pose.rotation, point - np.asarray(pose.position))


def arc_to(pose: Pose, point: NDArray[np.float64]) -> tuple[float, float]:
    """Bearing [rad] of a point, and curvature [1/m] of the arc tangent to the robot's heading through it (left > 0)."""
    x, y, _ = in_robot_frame(pose, point)
    return math.atan2(y, x), 2.0 * float(y) / max(float(x * x + y * y), 1e-6)


def heading_error(pose: Pose, other: Pose) -> float:
    """Angle [rad] in (-pi, pi] the robot has to turn left, about its own z axis, to look where ``other`` looks."""
    ahead = rotated_back(pose.rotation, other.rotation[:, 0])
    return math.atan2(ahead[1], ahead[0])


def ground_distance(pose: Pose, goal: Pose) -> float:
    """Distance [m] to the goal in the robot's tangent plane.

    A goal given a little above or below the ground, and a robot frame above it, do not count; a goal more than
    ``_SAME_STOREY`` off the plane is on other ground, then the distance is the straight one.
    """
    x, y, z = in_robot_frame(pose, np.asarray(goal.position))
    return math.hypot(x, y) if abs(z) <= _SAME_STOREY else math.hypot(x, y, z)


def is_at_goal(pose: Pose, goal: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
    """Whether ``pose`` is within ``dist_tolerance`` [m] and its heading within ``angle_tolerance`` [rad] of the goal.

    Distances and headings are those in the robot's tangent plane, so a goal given without the height and slope of
    the ground can be reached.
    """
    return ground_distance(pose, goal) <= dist_tolerance and abs(heading_error(pose, goal)) <= angle_tolerance


class ArrivalLatch:
    """Remembers that the goal's position was reached and only the heading is left.

    Once there, the robot may drift twice as far before it has to drive again, so turning does not flicker.

    Parameters
    ----------
    reach : float
        Distance [m] at which the position counts as reached.
    """

    def __init__(self, reach: float) -> None:
        self._reach = reach
        self._arrived = False

    def update(self, pose: Pose, goal: Pose) -> bool:
        """Take in the pose of this cycle; whether only turning is left."""
        self._arrived = ground_distance(pose, goal) <= self._reach * (2.0 if self._arrived else 1.0)
        return self._arrived


def clamp(value: float, limit: float) -> float:
    """Limit a value symmetrically to [-limit, limit]."""
    return max(-limit, min(limit, value))


def braking_speed(distance: float, deceleration: float) -> float:
    """Speed [m/s] from which a constant ``deceleration`` [m/s^2] stops the robot after ``distance`` [m]."""
    return math.sqrt(2.0 * deceleration * max(distance, 0.0))
