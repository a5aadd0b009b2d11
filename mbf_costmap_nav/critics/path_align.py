"""Keeps to the path: distance between the trajectory and the path after the same length travelled.

Not applied near the goal, where the path is too short to compare with (except for cars, which reach their heading only
by following the path), nor where the path itself is blocked: a robot that drives around an obstacle must leave the
path. Nor is it applied where a car faces away from its path: it has to leave the path in order to turn, and standing
still would have the least distance.
"""

from __future__ import annotations

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import alignment

ACTIVE_BEYOND = 0.5
"""Length [m] left on the path below which the goal critics take over."""
LEAST_FREE = 0.93
"""Share of free path points below which the path counts as blocked."""
STRIDE = 6
"""Every how many steps trajectory and path are compared."""


class PathAlignCritic(Critic):
    """Distance from the path."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Mean distance [m] over the steps."""
        if rollouts.path_free.mean() < LEAST_FREE:
            return None
        if rollouts.near_goal(ACTIVE_BEYOND):
            if rollouts.turning_radius == 0.0:
                return None
        elif rollouts.turning_radius > 0.0 and not rollouts.faces_path:
            return None
        return alignment(rollouts.poses, rollouts.path, rollouts.path_spacing, STRIDE)
