"""Limits that every command passes before it reaches the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mbf_abstract.geometry import AckermannCommand, Command, Twist

CURVATURE_TOLERANCE = 1e-6  # a controller that keeps to the same circle must not be corrected for its rounding


@dataclass(frozen=True)
class VelocityLimits:
    """Limits of commands; a component beyond its limit scales the whole command, so its direction is kept.

    Attributes
    ----------
    max_vel_x, min_vel_x : float
        Forward and (negative or zero) reverse limit [m/s].
    max_vel_y : float
        Sideways limit [m/s].
    max_vel_z : float
        Limit upwards and downwards [m/s].
    max_vel_roll, max_vel_pitch, max_vel_theta : float
        Roll, pitch and yaw rate limits [rad/s].
    max_steering_angle : float
        Limit of an Ackermann command's steering angle [rad], clamped on its own.
    min_turning_radius : float
        Radius [m] of the tightest curve; 0 = the robot may turn on the spot. A twist keeps its speed and loses what is
        too much of its yaw rate, all of it where it does not drive.
    """

    max_vel_x: float = math.inf
    min_vel_x: float = -math.inf
    max_vel_y: float = math.inf
    max_vel_z: float = math.inf
    max_vel_roll: float = math.inf
    max_vel_pitch: float = math.inf
    max_vel_theta: float = math.inf
    max_steering_angle: float = math.inf
    min_turning_radius: float = 0.0

    def apply(self, command: Command) -> Command:
        """Return the command within the limits; the same object if it already is."""
        if isinstance(command, AckermannCommand):
            speed = min(max(command.speed, self.min_vel_x), self.max_vel_x)
            angle = min(max(command.steering_angle, -self.max_steering_angle), self.max_steering_angle)
            limited = AckermannCommand(speed, angle)
            return command if limited == command else limited
        return self._scaled(self._curved(command))

    def _curved(self, command: Twist) -> Twist:
        """Widen a curve that is too tight."""
        speed = math.hypot(command.vx, command.vy)
        if abs(command.wz) * self.min_turning_radius <= speed * (1.0 + CURVATURE_TOLERANCE):
            return command
        wx, wy, wz = command.angular
        return Twist(command.linear, (wx, wy, math.copysign(speed / self.min_turning_radius, wz)))

    def _scaled(self, command: Twist) -> Twist:
        """Slow down what is too fast, all components alike: the curve stays."""
        vx, vy, vz = command.linear
        wx, wy, wz = command.angular
        scale = min(
            _scale(vx, self.max_vel_x if vx > 0.0 else -self.min_vel_x),
            _scale(vy, self.max_vel_y),
            _scale(vz, self.max_vel_z),
            _scale(wx, self.max_vel_roll),
            _scale(wy, self.max_vel_pitch),
            _scale(wz, self.max_vel_theta),
        )
        if scale >= 1.0:
            return command
        return Twist((vx * scale, vy * scale, vz * scale), (wx * scale, wy * scale, wz * scale))


def _scale(value: float, limit: float) -> float:
    return 1.0 if abs(value) <= limit else limit / abs(value)
