"""Turns towards the path where the robot faces away from it; not applied once it roughly faces it.

A car is scored by its final heading: it turns only while it drives, so the mean over the trajectory gains too little to
outweigh the cost of leaving the path.
"""

from __future__ import annotations

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_angle_to

ACTIVE_BEYOND = 0.5
"""Length [m] left on the path below which the goal critics take over."""


class PathAngleCritic(Critic):
    """Heading towards the path."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Mean angle [rad] to the direction of the point ahead, for a car the last one."""
        if rollouts.near_goal(ACTIVE_BEYOND) or rollouts.faces_path:
            return None
        poses = rollouts.poses[:, -1:] if rollouts.turning_radius > 0.0 else rollouts.poses
        return mean_angle_to(poses, rollouts.direction_ahead)
