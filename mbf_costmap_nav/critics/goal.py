"""Attracts to the goal once it is near: mean distance of the trajectory to it."""

from __future__ import annotations

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_distance_to_point

ACTIVE_WITHIN = 1.4
"""Length [m] left on the path below which this critic applies; before, the path critics do."""


class GoalCritic(Critic):
    """Distance to the goal."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Mean distance [m]."""
        if not rollouts.near_goal(ACTIVE_WITHIN):
            return None
        return mean_distance_to_point(rollouts.poses, rollouts.goal[0], rollouts.goal[1])
