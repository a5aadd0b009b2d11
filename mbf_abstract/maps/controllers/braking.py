"""Braking along the arc on which a robot rolls, once no motion is free any more; and no command beyond what it can do.

When to use: in every controller that looks along the arc of a command until the robot has stopped on it. A robot that
is only sent zero slows down its speed and its turn each as fast as it can: it leaves that arc for ground that nobody
has looked at. When not: robots that follow at once.

Rule: a refusal while the robot rolls is answered with the arc of the last command, slower by what the robot can brake
until the next one. What cannot be slowed down so fast, the speed or the turn, decides. Once it stands it is refused.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from functools import cached_property

from mbf_abstract.geometry import Command, Twist
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult

REFUSALS = (ExePathOutcome.BLOCKED_PATH, ExePathOutcome.NO_VALID_CMD, ExePathOutcome.COLLISION)
"""What says that no motion is free; after other failures the robot must not be driven on what is known of it."""


class LastFreeArc:
    """The arc of the last command that was found free."""

    def __init__(self) -> None:
        self._arc = Twist()

    def keep(self, command: Command | None) -> None:
        """Take note of a command; one with a steering angle has no arc to brake along."""
        self._arc = command if isinstance(command, Twist) else Twist()

    def answer(self, refusal: ControlResult, measured: Twist, inertia: InertiaParameters) -> ControlResult:
        """A refusal, or braking along the arc instead while the robot, ``measured`` to move so, still rolls on it."""
        self._arc = inertia.braked(self._arc, measured)
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

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Give the free motion, as far as the robot can do it until the next cycle, or brake along the last one."""
        result = self.free_motion(request)
        if not result.success:
            return self.last_arc.answer(result, request.velocity, self.inertia)
        if isinstance(result.command, Twist):
            result = replace(result, command=self.inertia.reached(result.command, request.velocity))
        self.last_arc.keep(result.command)
        return result
