"""Turning at the end of a path where that may be free only exactly there.

When to use: in controllers that turn on the spot to the goal's heading, on all maps. A planner has looked at the turn
at its goal. A robot that turns a centimetre beside it may touch something half-way, and there it can neither turn nor
drive on. When not: round robots, which can turn wherever they stand.

Rule: the whole turn is looked at before it begins. Where it is not free the robot creeps on to the exact end of the
path, and looks again; there, it turns to the other side, if that is free.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.maps.controllers.room_to_turn import LOOKS_ALONG, off_course

EXACTLY = 0.002
"""With less than this [m] left the robot is at the end of its path."""
SLOW, FAST = 0.05, 0.1
"""Speeds [m/s] at which it creeps there: within ``SLOW`` seconds' way of it, and farther off."""


def at_exact_end(
    pose: Pose, tracker: PathTracker, backward: bool, turn: float, turning: Callable[[float], Twist]
) -> list[Twist]:
    """Motions of a robot near the end of its path, in the order in which they are to be tried.

    Parameters
    ----------
    turn : float
        Angle [rad] to the goal's heading, the shorter way.
    turning : callable
        The turn on the spot by an angle [rad].
    """
    motions = [turning(turn)]
    bearing, curvature = arc_to(pose, np.array([tracker.goal.x, tracker.goal.y, pose.z]))
    if tracker.remaining > EXACTLY and abs(off_course(bearing, backward)) <= LOOKS_ALONG:
        speed = min(max(tracker.remaining, SLOW), FAST)
        speed = -speed if backward else speed
        motions.append(Twist.planar(speed, wz=speed * curvature))
    return [*motions, turning(turn - math.copysign(2.0 * math.pi, turn))]


def turn_left(turn: float, motion: Twist) -> float:
    """Angle [rad], 0 or more, that a turn on the spot has to go to what lies ``turn`` [rad] to the left."""
    return turn % (2.0 * math.pi) if motion.wz >= 0.0 else -turn % (2.0 * math.pi)


def swept_poses(pose: Pose, turn: float, step: float) -> FloatArray:
    """Poses (n, 3: x, y [m], yaw [rad]) of a turn on the spot by ``turn`` [rad], at whole multiples of ``step`` [rad].

    Whatever heading it begins at: so a robot that has come some way comes to no pose that was not looked at before.
    """
    first, last = sorted((pose.yaw, pose.yaw + turn))
    inner = step * np.arange(math.floor(first / step) + 1, math.ceil(last / step))
    headings = np.append(inner if turn >= 0.0 else inner[::-1], pose.yaw + turn)
    return np.column_stack([np.full(len(headings), pose.x), np.full(len(headings), pose.y), headings])
