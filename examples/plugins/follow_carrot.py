"""Controller `follow_carrot`: steer at a point of the path ahead; it needs no map and so runs on every backend.

When to use: open ground, and first tries of a backend of your own. When not: obstacles move; it looks at the path only.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult


class FollowCarrotParameters(PluginParameters):
    """Parameters of `follow_carrot`."""

    speed: float = parameter(0.5, "Speed straight ahead.", unit="m/s", gt=0.0, le=5.0)
    look_ahead: float = parameter(0.5, "Distance of the carrot along the path.", unit="m", gt=0.0, le=10.0)


class FollowCarrot(AbstractController):
    """Steers at a point of the path ahead; arrives anywhere near the last point, with any heading."""

    Parameters = FollowCarrotParameters
    parameters: FollowCarrotParameters

    def set_plan(self, path: Path) -> bool:
        """Take any path that has poses."""
        self._path = path
        return len(path) > 0

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Turn towards the carrot, and drive while it is ahead."""
        remaining = self._path.remaining_lengths
        nearest = int(np.linalg.norm(self._path.positions - request.pose.position, axis=1).argmin())
        ahead = remaining <= remaining[nearest] - self.parameters.look_ahead
        carrot = self._path.positions[int(ahead.argmax()) if ahead.any() else -1]
        x, y, _ = (carrot - request.pose.position) @ request.pose.rotation
        bearing = math.atan2(y, x)
        speed = self.parameters.speed * max(0.0, math.cos(bearing))
        return ControlResult(ExePathOutcome.SUCCESS, "driving", Twist.planar(speed, wz=1.5 * bearing))

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Compare the positions only."""
        return pose.distance_to(self._path[-1]) <= dist_tolerance
