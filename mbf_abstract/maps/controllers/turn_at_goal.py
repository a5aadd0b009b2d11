"""When a robot at the end of its path drives no more and only turns to the goal's heading.

When to use: in controllers that turn on the spot at the goal. A robot that turns drifts, and its pose is noisy: with
one limit it would go to and fro between both. While it turns it may be twice as far from the goal. If it then has the
heading, but stands out of the tolerance, it drives again: only turning it would stand there for ever. Where a turn may
be free at the exact end of the path only, see ``end_of_path``.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import Pose, normalize_angle
from mbf_abstract.geometry.tangent_plane import storey_gap

DRIFT = 2.0
"""So many times as far as before from its goal a robot may be while it turns."""
PATIENCE = 10
"""In so many cycles one after the other it has to have the heading and be out of the tolerance, to drive again."""


class TurnAtGoal:
    """Whether a robot only turns, from cycle to cycle.

    Parameters
    ----------
    reach : float
        Distance [m] from the goal at which it begins to, unless the goal's tolerance is less.
    """

    def __init__(self, reach: float) -> None:
        self.is_turning = False
        self._reach, self._angle_tolerance, self._cycles = reach, 0.0, 0

    def take_tolerances(self, dist_tolerance: float, angle_tolerance: float) -> None:
        """Take over the tolerances [m, rad] of the goal."""
        self._reach, self._angle_tolerance = min(self._reach, dist_tolerance), angle_tolerance

    def begin_within(self, reach: float) -> None:
        """Let a robot that comes no nearer turn where it stands, within a distance [m] of the goal."""
        self._reach = reach

    @property
    def limit(self) -> float:
        """How far [m] from the goal the robot may be in this cycle to turn only."""
        return self._reach * (DRIFT if self.is_turning else 1.0)

    def update(self, is_near: bool, turn: float) -> bool:
        """Decide for a cycle: is it within ``limit``, and what angle [rad] is it off the goal's heading."""
        self._cycles = self._cycles + 1 if is_near and abs(turn) <= self._angle_tolerance else 0
        self.is_turning = is_near and self._cycles <= PATIENCE
        return self.is_turning


def from_goal(pose: Pose, goal: Pose, same_storey: float) -> tuple[float, float]:
    """Distance [m] and angle [rad] from a pose to the goal, seen from above; in 3D to a goal on another storey."""
    gap = math.hypot(goal.x - pose.x, goal.y - pose.y)
    if same_storey < math.inf:
        gap = math.hypot(gap, storey_gap(pose, np.asarray(goal.position), same_storey))
    return gap, normalize_angle(goal.yaw - pose.yaw)
