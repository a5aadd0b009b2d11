"""Turns towards the path where the robot looks away from it; silent once it roughly faces it.

A car is judged by the heading it ends with: it turns only while it drives, so over the whole way it gains too little to
make up for what driving away from the path costs.
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
