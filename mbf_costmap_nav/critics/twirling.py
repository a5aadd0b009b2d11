"""Keeps an omnidirectional robot from turning for no reason."""

from __future__ import annotations

from mbf_costmap_nav.critics.base import Critic, Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_of


class TwirlingCritic(Critic):
    """Yaw rate."""

    def score(self, rollouts: Rollouts) -> Float32Array:
        """Mean yaw rate [rad/s]."""
        return mean_of(rollouts.velocities[2], False)
