"""How long a controller has commanded nothing that gets its robot anywhere.

When to use: in controllers that choose among sampled motions. The best of them may be to stand, to go to and fro by a
centimetre, or to turn round and round, for ever. When not: for what the robot does with its commands; wheels that do
not turn, or a guard that holds the robot back, are seen by the watches of the core.
"""

from __future__ import annotations

import math

from mbf_abstract.geometry import AckermannCommand, Command, Twist
from mbf_abstract.parameters import ParameterModel, parameter

MOVED, TURNED = 0.1, 0.5
"""A robot that is commanded so far [m, rad] from where it began to stand gets on ..."""
SPAN = 0.5
"""... or as far as its full speed would take it in so long [s], if that is less."""
ROUND = 2.0 * math.pi
"""... but having turned so far [rad] in all at one place it has faced every direction: more turns lead nowhere."""
FORGOTTEN = 1.0
"""A controller that has not been asked for this long [s] begins anew."""


class StandingParameters(ParameterModel):
    """What a controller does whose sampled motions get the robot nowhere."""

    keep_to_path_after: float = parameter(
        2.0,
        "Having stood for so long it drives along its path itself, without sampling; inf = never.",
        unit="s",
        ge=0.0,
        allow_inf=True,
    )
    give_up_after: float = parameter(
        6.0, "Having stood for so long it answers NO_VALID_CMD; inf = never.", unit="s", gt=0.0, allow_inf=True
    )


class Standing:
    """Adds up commands and the time in which they led nowhere."""

    def __init__(self) -> None:
        self._offset = (0.0, 0.0, 0.0)
        self._faced = self._turned = 0.0
        self._command: Command | None = None
        self._since = self._asked = -math.inf

    def restart(self, now: float) -> None:
        """It stands from ``now`` [s] on, at the earliest."""
        self._offset, self._since = (0.0, 0.0, 0.0), now
        self._faced = self._turned = 0.0

    def may_turn_again(self) -> None:
        """Let it turn once around from now on: somebody else chooses its turns."""
        self._turned = 0.0

    def commanded(self, command: Command | None) -> None:
        """Take note of the command that holds until the controller is asked again; None = it failed."""
        self._command = command

    def time(self, now: float, speed: float, yaw_rate: float) -> float:
        """How long [s] the robot has stood at ``now`` [s].

        Parameters
        ----------
        speed, yaw_rate : float
            The most [m/s, rad/s] that it may drive and turn here. One that may do neither does not count as standing.
        """
        passed, self._asked = now - self._asked, now
        if passed > FORGOTTEN:
            self.restart(now)
        elif self._command is not None:
            before = self._offset[2]
            self._offset = moved_on(self._offset, self._command, passed)
            self._turned += abs(self._offset[2] - before)
        x, y, yaw = self._offset
        if math.hypot(x, y) >= min(MOVED, SPAN * speed):
            self.restart(now)
        elif abs(yaw - self._faced) >= min(TURNED, SPAN * yaw_rate) and self._turned < ROUND:
            self._faced, self._since = yaw, now
        return now - self._since


def moved_on(pose: tuple[float, float, float], command: Command, duration: float) -> tuple[float, float, float]:
    """Where (x, y [m], yaw [rad]) a command leads in ``duration`` [s]; a car's curve counts as straight."""
    motion = Twist.planar(command.speed) if isinstance(command, AckermannCommand) else command
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    forward, left = motion.vx * duration, motion.vy * duration
    return x + c * forward - s * left, y + s * forward + c * left, yaw + motion.wz * duration
