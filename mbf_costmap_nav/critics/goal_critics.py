"""Critics near the goal: the distance to it, and its heading. Farther away the path critics apply."""

from __future__ import annotations

import math

from mbf_costmap_nav.critics.rollouts import Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import mean_angle_to, mean_distance_to_point

GOAL_WITHIN = 1.4
"""Length [m] left on the path below which the distance to the goal counts."""
CAR_WITHIN = 1.0
"""Length [m] left on the path below which a car is scored by its final heading."""


def goal(rollouts: Rollouts) -> Float32Array | None:
    """Attract to the goal: mean distance [m] of the trajectory to it."""
    if not rollouts.near_goal(GOAL_WITHIN):
        return None
    return mean_distance_to_point(rollouts.poses, rollouts.goal[0], rollouts.goal[1])


def goal_angle(rollouts: Rollouts) -> Float32Array | None:
    """Turn to the goal's heading within the tolerance of its position: mean angle [rad].

    A car cannot turn there, so near the goal it is scored by its final heading.
    """
    if not rollouts.on_last_section:
        return None
    if rollouts.turning_radius > 0.0 and rollouts.near_goal(CAR_WITHIN):
        return mean_angle_to(rollouts.poses[:, -1:], rollouts.goal[2])
    near = math.hypot(rollouts.goal[0], rollouts.goal[1]) <= rollouts.goal_tolerance
    return mean_angle_to(rollouts.poses, rollouts.goal[2]) if near else None
