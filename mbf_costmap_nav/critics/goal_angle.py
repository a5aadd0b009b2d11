"""Turns to the goal's heading once the robot stands within the tolerance of the goal's position."""

from __future__ import annotations

import math

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.critics import mean_angle_to


class GoalAngleCritic(Critic):
    """Distance to the goal's heading."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Mean angle [rad]."""
        if not rollouts.on_last_section:
            return None
        near = math.hypot(rollouts.goal[0], rollouts.goal[1]) <= rollouts.goal_tolerance
        return mean_angle_to(rollouts.poses, rollouts.goal[2]) if near else None
