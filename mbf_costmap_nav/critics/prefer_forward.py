"""Prefers driving forward, where the sensors look."""

from __future__ import annotations

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.critics import mean_of


class PreferForwardCritic(Critic):
    """Speed backward."""

    def score(self, rollouts: Rollouts) -> Float32Array:
        """Mean backward speed [m/s]."""
        return mean_of(rollouts.velocities[0], True)
