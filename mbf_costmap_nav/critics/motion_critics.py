"""Critics of the motion itself: driving against the direction of travel, and turning."""

from __future__ import annotations

from mbf_costmap_nav.critics.rollouts import Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_of


def prefer_forward(rollouts: Rollouts) -> Float32Array:
    """Prefer driving forward, where the sensors look: mean backward speed [m/s]; the forward one on a reverse path."""
    forward = rollouts.velocities[0]
    return mean_of(-forward if rollouts.backward else forward, True)


def twirling(rollouts: Rollouts) -> Float32Array:
    """Keep an omnidirectional robot from turning for no reason: mean yaw rate [rad/s]."""
    return mean_of(rollouts.velocities[2], False)
