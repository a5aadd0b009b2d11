"""Braking along the arc on which a robot rolls, once no motion is free any more; and no command beyond what it can do.

When to use: in every controller that looks along the arc of a command until the robot has stopped on it. A robot that
is only sent zero slows down its speed and its turn each as fast as it can: it leaves that arc for ground that nobody
has looked at. When not: robots that follow at once.

Rule: a refusal while the robot rolls is answered with the arc of the last command, slower by what the robot can brake
until the next one. What cannot be slowed down so fast, the speed or the turn, decides. Once it stands it is refused.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace
from functools import cached_property

from mbf_abstract.geometry import Command, Twist
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult

REFUSALS = (ExePathOutcome.BLOCKED_PATH, ExePathOutcome.NO_VALID_CMD, ExePathOutcome.COLLISION)
"""What says that no motion is free; after other failures the robot must not be driven on what is known of it."""


RECENT = 0.3
"""A robot still has a command that it was given less than this time [s] ago."""


class LastFreeArc:
    """The arc of the last command that was found free."""

    def __init__(self) -> None:
        self._arc, self._given, self._given_at = Twist(), Twist(), -math.inf

    def keep(self, command: Command | None, now: float) -> None:
        """Take note of a command given ``now`` [s]; one with a steering angle has no arc to brake along."""
        self._arc = self._given = command if isinstance(command, Twist) else Twist()
        self._given_at = now

    def begins_at(self, command: Twist, measured: Twist, now: float) -> Twist:
        """The velocity from which a robot goes on to a command: its last command where it lags behind that.

        Wheels that slip and weak motors never do all that is commanded. Counted from what is measured, such a robot
        would be commanded a little more than that for ever.
        """
        if now - self._given_at > RECENT:
            return measured
        given = self._given
        lags = _apart(given, command) < _apart(measured, command)
        turns = abs(given.wz - command.wz) < abs(measured.wz - command.wz)
        straight = given if lags else measured
        return Twist.planar(straight.vx, straight.vy, given.wz if turns else measured.wz)

    def answer(self, refusal: ControlResult, measured: Twist, inertia: InertiaParameters) -> ControlResult:
        """A refusal, or braking along the arc instead while the robot, ``measured`` to move so, still rolls on it."""
        self._arc = self._given = inertia.braked(self._arc, measured)
        if refusal.outcome not in REFUSALS or self._arc == Twist():
            return refusal
        return ControlResult(ExePathOutcome.SUCCESS, f"it brakes: {refusal.message}", self._arc)


class BrakesOnItsArc(AbstractController):
    """A controller that is asked for a free motion, and brakes along the last one where there is none."""

    @cached_property
    def last_arc(self) -> LastFreeArc:
        """What it brakes along."""
        return LastFreeArc()

    @property
    @abstractmethod
    def inertia(self) -> InertiaParameters:
        """What is stated of the robot's inertia; one that follows at once does not brake."""

    @abstractmethod
    def free_motion(self, request: ControlRequest) -> ControlResult:
        """The motion of this cycle, found free until the robot has stopped on its arc, or a refusal."""

    def goes_on_from(self, command: Twist, measured: Twist) -> Twist:
        """What a command is counted from, see ``LastFreeArc.begins_at``; of robots that follow what is measured."""
        if self.inertia.follows_at_once:
            return measured
        return self.last_arc.begins_at(command, measured, self.clock.now())

    def reachable(self, command: Twist, measured: Twist, turning: float) -> Twist:
        """What the robot can do of a command until the next one, at most at a yaw rate [rad/s]; it keeps to the arc."""
        return self.inertia.reachable(command, measured, turning, self.goes_on_from(command, measured))

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Give the free motion, as far as the robot can do it until the next cycle, or brake along the last one."""
        result = self.free_motion(request)
        if not result.success:
            return self.last_arc.answer(result, request.velocity, self.inertia)
        if isinstance(result.command, Twist):
            begin = self.goes_on_from(result.command, request.velocity)
            result = replace(result, command=self.inertia.reached(result.command, begin))
        self.last_arc.keep(result.command, self.clock.now())
        return result


def _apart(one: Twist, other: Twist) -> float:
    return math.hypot(one.vx - other.vx, one.vy - other.vy)
