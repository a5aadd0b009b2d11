"""Turns to the goal's heading once the robot stands within the tolerance of the goal's position.

A car cannot turn there, so near the goal it is scored by its final heading.
"""

from __future__ import annotations

import math

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_angle_to

CAR_WITHIN = 1.0
"""Length [m] left on the path below which a car is scored by its final heading."""


class GoalAngleCritic(Critic):
    """Distance to the goal's heading."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Mean angle [rad]."""
        if not rollouts.on_last_section:
            return None
        if rollouts.turning_radius > 0.0 and rollouts.near_goal(CAR_WITHIN):
            return mean_angle_to(rollouts.poses[:, -1:], rollouts.goal[2])
        near = math.hypot(rollouts.goal[0], rollouts.goal[1]) <= rollouts.goal_tolerance
        return mean_angle_to(rollouts.poses, rollouts.goal[2]) if near else None
