"""Prefers driving forward, where the sensors look; backward where the poses of the path require it."""

from __future__ import annotations

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_of


class PreferForwardCritic(Critic):
    """Speed in the wrong direction."""

    def score(self, rollouts: Rollouts) -> Float32Array:
        """Mean backward speed [m/s]; where the path is driven in reverse, the mean forward one."""
        forward = rollouts.velocities[0]
        return mean_of(-forward if rollouts.backward else forward, True)
