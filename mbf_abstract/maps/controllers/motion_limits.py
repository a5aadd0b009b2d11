"""What a controller may command in one cycle, and what the robot makes of a command until the next one.

When to use: for all that a controller commands in the end, whatever chose it. When not: to look whether a motion is
free, for which ``InertiaParameters`` keep its arc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.controllers.inertia import reached


@dataclass(frozen=True)
class MotionLimits:
    """What a controller may command in one cycle.

    Attributes
    ----------
    slowest, fastest : float
        Least and largest speed [m/s]; negative = backward.
    turning : float
        Largest yaw rate [rad/s].
    is_car : bool
        Whether the robot cannot turn on the spot.
    gain, side_gain, turn_gain : float
        By how much [m/s, m/s, rad/s] vx, vy and the yaw rate may differ from the measured ones, vx and vy together.
    leaves_contacts : bool
        False = the controller may drive on ground that the map forbids: what the map calls a contact is none for it.
    """

    slowest: float
    fastest: float
    turning: float
    is_car: bool = False
    gain: float = math.inf
    side_gain: float = math.inf
    turn_gain: float = math.inf
    leaves_contacts: bool = True

    def reached(self, command: Twist, measured: Twist) -> Twist:
        """What the robot makes of a command until the next one; a car's curve gets no tighter than commanded."""
        result = reached(command, measured, (self.gain, self.side_gain, self.turn_gain))
        if not self.is_car or result == command:
            return result
        curve = command if command.vx != 0.0 else measured
        tightest = abs(curve.wz / curve.vx * result.vx) if curve.vx != 0.0 else 0.0
        return Twist.planar(result.vx, 0.0, max(-tightest, min(tightest, result.wz)))

    def hold(self, command: Twist, measured: Twist) -> Twist:
        """The same arc within the limits."""
        speed, turn = abs(command.vx), abs(command.wz)
        fastest = min(self.fastest if command.vx >= 0.0 else -self.slowest, abs(measured.vx) + self.gain)
        turning = min(self.turning, abs(measured.wz) + self.turn_gain)
        share = min(fastest / speed if speed > fastest else 1.0, turning / turn if turn > turning else 1.0)
        return Twist.planar(share * command.vx, 0.0, share * command.wz)
