"""Moving the robot inside a recovery on a costmap: the footprint is checked ahead of every command.

A behaviour ends with IMPASSABLE before the footprint would meet an obstacle or the end of the map. A robot that already
touches one may move as long as it touches no more than before, so backing out of a collision works and driving deeper
into it does not. Where the whole footprint lies on obstacles no direction is known to lead out, and only ``escape``
moves.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps import guarded_motion
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint_check import FootprintCheck, arc_poses
from mbf_costmap_nav.plugins import CostmapRecovery


class GuardedMotionParameters(guarded_motion.GuardedMotionParameters):
    """Parameters every moving recovery on a costmap has."""

    check_ahead_time: float = parameter(0.6, "How far ahead the footprint is checked.", unit="s", gt=0.0, le=10.0)


class GuardedRecovery(CostmapRecovery, guarded_motion.GuardedRecovery):
    """Base of the recoveries that move the robot: write ``recover`` and use ``drive``."""

    parameters: GuardedMotionParameters

    leaves_collisions: ClassVar[bool] = False
    """Whether the recovery itself chooses motions that lead out of a collision, however deep it is."""

    def stale_reason(self) -> str:
        """Why the costmap is too old to drive on; empty if it is fresh."""
        return self.costmap.stale_reason(self.clock.now())

    def obstacle_ahead(self, pose: Pose, command: Twist) -> str:
        """Say where moving on would touch more of obstacles and the end of the map than now; empty: the way is free."""
        costmap, pose = self.costmap.snapshot(), self.on_map(pose)
        check = FootprintCheck(self.costmap.footprint, costmap.resolution)

        def touched(x: float, y: float, yaw: float) -> int:
            return check.lethal_count(costmap, x, y, yaw) + check.outside_count(costmap, x, y, yaw)

        allowed = touched(pose.x, pose.y, pose.yaw)
        if not self.leaves_collisions:
            allowed = min(allowed, len(check.samples) - 1)
        for x, y, yaw in self._poses_ahead(pose, command, costmap):
            if touched(x, y, yaw) > allowed:
                return f"an obstacle is in the way: the footprint would touch it at ({x:.2f}, {y:.2f}, {yaw:.2f} rad)"
        return ""

    def _poses_ahead(self, pose: Pose, command: Twist, costmap: Costmap) -> list[list[float]]:
        duration = self.parameters.check_ahead_time
        rim_speed = command.speed + abs(command.wz) * self.costmap.circumscribed_radius
        step = float(np.clip(0.5 * costmap.resolution / max(rim_speed, 1e-6), duration / 100.0, duration))
        poses = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, duration, step)
        return [list(row) for row in poses.tolist()]
