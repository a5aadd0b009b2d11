"""A map for a round robot that knows one thing: where the obstacles around a place are.

Derive from ``DiscMap`` in a map backend of your own: the recoveries of the core run on it. Not for robots whose outline
matters, nor for surfaces above each other.
"""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.navigation_map import NavigationMap

STRIDE = 0.05
"""Distance [m] between two places that are looked at along a motion."""


class DiscMap(NavigationMap):
    """A map for a disc.

    Attributes
    ----------
    robot_radius : float
        Radius [m] of the disc.
    """

    robot_radius: float

    @abstractmethod
    def obstacles_near(self, x: float, y: float, within: float) -> FloatArray:
        """Places (n, 2) [m] of all obstacles within a distance [m]; others may be there, and what is off the map."""

    @property
    def inscribed_radius(self) -> float:
        """Radius [m] of the disc."""
        return self.robot_radius

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where the disc would come to touch an obstacle, or nearer to one it touches."""
        if command.speed == 0.0:
            return ""
        step = min(STRIDE / command.speed, duration)
        ahead = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, duration, step)
        before = self.clearance(pose.x, pose.y)
        for x, y, _ in ahead.tolist():
            clearance = self.clearance(x, y)
            if clearance < self.robot_radius and clearance < before:
                return f"an obstacle is in the way: the robot would touch it at ({x:.2f}, {y:.2f})"
            before = clearance
        return ""

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest obstacle; None if none is ``within`` [m]."""
        offsets = self.obstacles_near(pose.x, pose.y, within) - (pose.x, pose.y)
        distances = np.hypot(offsets[:, 0], offsets[:, 1])
        if len(distances) == 0 or distances.min() > within:
            return None
        dx, dy = offsets[int(np.argmin(distances))].tolist()
        return dx, dy, 0.0

    def clearance(self, x: float, y: float) -> float:
        """Distance [m] of the nearest obstacle from a place; may be inf beyond the radius of the disc."""
        offset = self.nearest_obstacle(Pose.planar(x, y, frame_id=self.frame_id), self.robot_radius)
        return math.inf if offset is None else math.hypot(*offset)
