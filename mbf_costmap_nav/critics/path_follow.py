"""Rewards progress: distance from the trajectory's end to a free path point a little beyond what any sample reaches.

Not applied where a robot that can turn on the spot faces away from its path: it would drive the path backward.
"""

from __future__ import annotations

import numpy as np

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts

ACTIVE_BEYOND = 0.5
"""Length [m] left on the path below which the goal critics take over."""
AHEAD = 5
"""How many path points beyond the furthest reached one the target lies."""


class PathFollowCritic(Critic):
    """Progress along the path."""

    def score(self, rollouts: Rollouts) -> Float32Array | None:
        """Distance [m] of the last pose to the target point."""
        if rollouts.near_goal(ACTIVE_BEYOND) or rollouts.has_to_turn:
            return None
        index = min(rollouts.furthest + AHEAD, len(rollouts.path) - 1)
        free_beyond = np.flatnonzero(rollouts.path_free[index:])
        target = rollouts.path[index + (free_beyond[0] if free_beyond.size else 0)]
        return np.asarray(np.hypot(rollouts.poses[0, -1] - target[0], rollouts.poses[1, -1] - target[1]))
