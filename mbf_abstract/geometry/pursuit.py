"""Pure pursuit: where a point lies from the robot, and the arc that leads there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import rotated_back
from mbf_abstract.geometry.pose import Pose


def in_robot_frame(pose: Pose, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates (3,) of a global point in the robot's frame: x ahead, y left, both in its tangent plane."""
    return rotated_back(pose.rotation, point - np.asarray(pose.position))


def arc_to(pose: Pose, point: NDArray[np.float64]) -> tuple[float, float]:
    """Bearing [rad] of a point, and curvature [1/m] of the arc tangent to the robot's heading through it (left > 0)."""
    x, y, _ = in_robot_frame(pose, point)
    return math.atan2(y, x), 2.0 * float(y) / max(float(x * x + y * y), 1e-6)
