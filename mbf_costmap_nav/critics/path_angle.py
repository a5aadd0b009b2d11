"""Turns towards the path where the robot looks away from it; silent once it roughly faces it."""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import normalize_angle
from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.critics import mean_angle_to

ACTIVE_BEYOND = 0.5
"""Length [m] left on the path below which the goal critics take over."""
AHEAD = 4
"""How many path points beyond the furthest reached one the robot should look at."""
FACING = 0.785
"""Angle [rad] to that point below which the critic is silent."""


class PathAngleCritic(Critic):
    """Heading towards the path."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Mean angle [rad] to the direction of the point ahead."""
        if rollouts.remaining <= ACTIVE_BEYOND:
            return None
        x, y = rollouts.path[min(max(rollouts.furthest, AHEAD) + AHEAD, len(rollouts.path) - 1)].tolist()
        direction = float(np.arctan2(y, x))
        if abs(normalize_angle(direction - float(rollouts.poses[2, 0, 0]))) < FACING:
            return None
        return mean_angle_to(rollouts.poses, direction)
