"""Stops a robot in time before what moves, whatever its controller: slower along the same arc, or not at all.

When to use: by the server of a map, after each answer of a controller; on maps whose layers track objects. When not: to
drive around, which planners do by the costs of predicted places, and sampling controllers by looking ahead in time
(``avoidance.py``).

A robot that waits follows a command of zero, so its controller has not failed. A controller that looks ahead waits by
itself and says for whom (``hindered_by``). After ``max_wait`` of either the path counts as blocked, and the executive
decides.
"""

from __future__ import annotations

import math
from dataclasses import replace

from mbf_abstract.geometry import AckermannCommand, Command, Pose, Twist
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult

CONTINUED = 1.0
"""A robot that was not asked to wait for this long [s] begins to wait anew."""
STANDSTILL = 0.05
"""A robot that is hindered and whose command is slower than this [m/s] waits."""


class ContactGuard:
    """Judges the commands for one robot."""

    def __init__(self) -> None:
        self._waiting_since = self._last = -math.inf

    def judge(
        self, navigation_map: NavigationMap, pose: Pose, velocity: Twist, answer: ControlResult, now: float
    ) -> ControlResult:
        """The answer of a controller with a command that is safe.

        Parameters
        ----------
        navigation_map : NavigationMap
            The one the robot drives on.
        pose : Pose
            Of the robot, in the frame of the map.
        velocity : Twist
            Measured.
        answer : ControlResult
            With a command.
        now : float
            [s]
        """
        command = answer.command
        if command is None:
            return answer
        motion = Twist.planar(command.speed) if isinstance(command, AckermannCommand) else command
        share, reason, max_wait = navigation_map.safe_share(pose, velocity, motion, now)
        safe = answer if share == 1.0 else replace(answer, command=slower(command, share), message=reason)
        if share > 0.0:
            if not answer.hindered_by or share * abs(command.speed) >= STANDSTILL:
                return safe
            reason, max_wait = answer.hindered_by, navigation_map.max_wait
        if now - self._last > CONTINUED:
            self._waiting_since = now
        self._last = now
        waited = now - self._waiting_since
        if waited > max_wait:
            return ControlResult(ExePathOutcome.BLOCKED_PATH, f"{reason}; waited {waited:.1f} s for it")
        return replace(safe, message=reason)


def slower(command: Command, share: float) -> Command:
    """The same arc at a share of the speed; a car keeps its steering angle."""
    if isinstance(command, AckermannCommand):
        return replace(command, speed=share * command.speed)
    return Twist.planar(share * command.vx, share * command.vy, share * command.wz)
