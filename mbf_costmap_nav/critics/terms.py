"""Critics of the path, of the goal and of the motion itself.

Along the path: the distance from it, the heading towards it, and the progress on it. Near the goal: the distance to it,
and its heading. Of the motion: driving against the direction of travel, and turning.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_costmap_nav.critics.rollouts import Float32Array, Rollouts
from mbf_costmap_nav.kernels.control.critics import alignment, mean_angle_to, mean_distance_to_point, mean_of

ACTIVE_BEYOND = 0.5
"""Length [m] left on the path below which the goal critics take over."""
LEAST_FREE = 0.93
"""Share of free path points below which the path counts as blocked."""
STRIDE = 6
"""Every how many steps trajectory and path are compared."""
AHEAD = 5
"""How many path points beyond the furthest reached one the target of the progress lies."""
GOAL_WITHIN = 1.4
"""Length [m] left on the path below which the distance to the goal counts."""
CAR_WITHIN = 1.0
"""Length [m] left on the path below which a car is scored by its final heading."""


def path_align(rollouts: Rollouts) -> Float32Array | None:
    """Keep to the path: mean distance [m] between trajectory and path after the same length travelled.

    Not applied near the goal, where the path is too short to compare with (except for cars, which reach their heading
    only by following the path), nor where the path itself is blocked: a robot that drives around an obstacle must leave
    the path. Nor is it applied where a car faces away from its path: it has to leave the path in order to turn, and
    standing still would have the least distance.
    """
    if rollouts.path_free.mean() < LEAST_FREE:
        return None
    if rollouts.near_goal(ACTIVE_BEYOND):
        if rollouts.turning_radius == 0.0:
            return None
    elif rollouts.turning_radius > 0.0 and not rollouts.faces_path:
        return None
    return alignment(rollouts.poses, rollouts.path, rollouts.path_spacing, STRIDE)


def path_angle(rollouts: Rollouts) -> Float32Array | None:
    """Turn towards the path, until the robot roughly faces it: mean angle [rad] to the direction of the point ahead.

    A car is scored by its final heading: it turns only while it drives, so the mean over the trajectory gains too
    little to outweigh the cost of leaving the path.
    """
    if rollouts.near_goal(ACTIVE_BEYOND) or rollouts.faces_path:
        return None
    poses = rollouts.poses[:, -1:] if rollouts.turning_radius > 0.0 else rollouts.poses
    return mean_angle_to(poses, rollouts.direction_ahead)


def path_follow(rollouts: Rollouts) -> Float32Array | None:
    """Reward progress: distance [m] of the last pose to a free path point a little beyond what any sample reaches.

    Not applied where a robot that can turn on the spot faces away from its path: it would drive the path backward.
    """
    if rollouts.near_goal(ACTIVE_BEYOND) or rollouts.has_to_turn:
        return None
    index = min(rollouts.furthest + AHEAD, len(rollouts.path) - 1)
    free_beyond = np.flatnonzero(rollouts.path_free[index:])
    target = rollouts.path[index + (free_beyond[0] if free_beyond.size else 0)]
    return np.asarray(np.hypot(rollouts.poses[0, -1] - target[0], rollouts.poses[1, -1] - target[1]))


def prefer_forward(rollouts: Rollouts) -> Float32Array:
    """Prefer driving forward, where the sensors look: mean backward speed [m/s]; the forward one on a reverse path."""
    forward = rollouts.velocities[0]
    return mean_of(-forward if rollouts.backward else forward, True)


def twirling(rollouts: Rollouts) -> Float32Array:
    """Keep an omnidirectional robot from turning for no reason: mean yaw rate [rad/s]."""
    return mean_of(rollouts.velocities[2], False)


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
