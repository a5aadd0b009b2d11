"""The stick of the page: who holds it, and whether still, by the clock on the wall.

While it is held the visitor's page reports it ten times a second, each time with the newest heartbeat of the server
that it has seen. A report is as old as its heartbeat: since then the person may have let go. No report younger than
``longest_silence`` is a release: a lost connection, a slow one that keeps reports back, a page that hangs, a laptop
that was closed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from mbf_abstract.drive.teleoperation import TAKING_OVER, Teleoperation
from mbf_abstract.geometry import Twist
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock

SILENCE = 0.5  # s of wall time; command_timeout of the configuration where that is shorter
MAX_SPEED, MAX_TURN = 0.5, 1.0  # m/s, rad/s; of a robot whose configuration has no limits
FIRST_SHARE = 0.5


class Position(NamedTuple):
    """Where a visitor holds the stick, -1 to 1, and the heartbeat that the page had seen then, a time [s]."""

    visitor: int
    turn: float
    forward: float
    beat: float


class Stick:
    """Drives a robot as a visitor holds the stick; ``hold`` and ``release`` come from any thread.

    Parameters
    ----------
    wall : Clock
        Wall time.
    take_over : callable
        Cancels what drives the robot; called when somebody takes the stick, on the thread of ``step``.
    on_end : callable
        Takes why the stick is not held any more, on that thread.

    Attributes
    ----------
    share : float
        How much of the robot's limits the stick at its end asks for, 0 to 1.
    """

    def __init__(
        self,
        server: AbstractNavigationServer,
        wall: Clock,
        take_over: Callable[[], None],
        on_end: Callable[[str], None],
    ) -> None:
        self.share = FIRST_SHARE
        self._server = server
        self._wall = wall
        self._take_over, self._on_end = take_over, on_end
        self._teleoperation = Teleoperation(server.runtime)
        self._position: Position | None = None
        self._drives = False

    @property
    def holder(self) -> int | None:
        """The visitor who holds it; None if nobody does."""
        position = self._position
        return None if position is None else position.visitor

    @property
    def longest_silence(self) -> float:
        """Age [s] of a report at which the stick counts as released."""
        return min(SILENCE, self._server.runtime.parameters.command_timeout)

    def hold(self, visitor: int, turn: float, forward: float, beat: float) -> str:
        """Note where a visitor holds it, at a heartbeat [s]; return why it is not taken, empty if it is."""
        if self.holder not in (None, visitor):
            return "somebody else holds the stick"
        age = self._wall.now() - beat
        if not 0.0 <= age <= self.longest_silence:
            return f"the connection is too slow to drive: {age:.1f} s there and back"
        self._position = Position(visitor, turn, forward, beat)
        return ""

    def release(self, visitor: int) -> None:
        """Note that a visitor does not hold it."""
        if self.holder == visitor:
            self._position = None

    def step(self, is_paused: bool) -> None:
        """Drive, or stop; between two steps of the world."""
        position, reason = self._position, "the stick was released"
        if position is not None and self._wall.now() - position.beat > self.longest_silence:
            self._position, reason = None, "the page that held the stick is silent"
        elif position is not None and is_paused:
            reason = "paused"
        elif position is not None:
            if not self._drives:
                self._drives = True
                self._take_over()
            self._teleoperation.hold(self._command(position))
            return
        self.stop(reason)

    def stop(self, reason: str) -> None:
        """Stop the robot if somebody drives it by hand; on the thread of ``step``."""
        if self._drives:
            self._drives = False
            self._teleoperation.release(reason)
            self._on_end(reason)

    def status(self, is_paused: bool) -> str:
        """What the robot makes of it."""
        if is_paused:
            return "paused: the stick does nothing until Resume"
        if not self._drives:  # no step since it was taken: nothing has moved yet
            return TAKING_OVER
        return self._teleoperation.problem or "driving"

    def _command(self, position: Position) -> Twist:
        limits = self._server.runtime.gate.limits
        forward, backward = _finite(limits.max_vel_x, MAX_SPEED), _finite(-limits.min_vel_x, MAX_SPEED)
        vx = position.forward * (forward if position.forward > 0.0 else backward)
        return Twist.planar(self.share * vx, 0.0, self.share * position.turn * _finite(limits.max_vel_theta, MAX_TURN))


def _finite(limit: float, otherwise: float) -> float:
    return limit if math.isfinite(limit) else otherwise
