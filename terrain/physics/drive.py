"""Velocity commands to wheel speeds and back, for the three drives of ``terrain.physics.robot_models``; pure functions.

Skid-steered and differential: left and right speed differ by yaw rate x effective track. Car: bicycle model, with the
steered wheels turned so that all axles meet in one point (Ackermann), and the others at the speeds of their circles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mbf_abstract.geometry import AckermannCommand, Command, Twist
from terrain.physics.robot_models import Drive, RobotSpec

STEERING_SPEED = 3.0  # rad/s; how fast a car turns its wheels
MIN_STEERING_SPEED = 0.05  # m/s; a slower car that is asked for a yaw rate turns its wheels as for this speed


@dataclass(frozen=True)
class WheelTargets:
    """Speeds [rad/s] of the left and right driven wheels, angles [rad] of the left and right steered wheels.

    Both angles are that of the steered wheel where there is one.
    """

    left: float = 0.0
    right: float = 0.0
    steering_left: float = 0.0
    steering_right: float = 0.0


def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def steering_angle(spec: RobotSpec, twist: Twist) -> float:
    """Bicycle steering angle [rad] at which a car driving ``twist.vx`` turns at ``twist.wz``."""
    if twist.wz == 0.0:
        return 0.0
    speed = math.copysign(max(abs(twist.vx), MIN_STEERING_SPEED), twist.vx)
    return _clip(math.atan(spec.wheelbase * twist.wz / speed), spec.max_steering_angle)


def steering_command(spec: RobotSpec, command: Command) -> float:
    """Bicycle steering angle [rad] that a command asks of a car, inside the robot's limits."""
    if isinstance(command, AckermannCommand):
        return _clip(command.steering_angle, spec.max_steering_angle)
    return steering_angle(spec, command)


def wheel_targets(spec: RobotSpec, command: Command) -> WheelTargets:
    """Turn a command into wheel speeds, first bringing it inside the robot's limits.

    Raises
    ------
    TypeError
        An ``AckermannCommand`` for a robot that cannot steer.
    """
    if spec.drive is Drive.ACKERMANN:
        return _car_targets(spec, command)
    if isinstance(command, AckermannCommand):
        raise TypeError(f"{spec.name} cannot steer: expected a Twist, got an AckermannCommand")
    speed = _clip(command.vx, spec.max_speed)
    yaw_rate = _clip(command.wz, spec.max_yaw_rate)
    half = 0.5 * yaw_rate * spec.track * spec.track_multiplier
    return WheelTargets((speed - half) / spec.wheel_radius, (speed + half) / spec.wheel_radius)


def _car_targets(spec: RobotSpec, command: Command) -> WheelTargets:
    if isinstance(command, Twist):
        command = AckermannCommand(command.vx, steering_angle(spec, command))
    speed = _clip(command.speed, spec.max_speed) / spec.wheel_radius
    angle = _clip(command.steering_angle, spec.max_steering_angle)
    curvature = math.tan(angle) / spec.wheelbase
    inner, outer = (
        1.0 - 0.5 * spec.track * curvature,
        1.0 + 0.5 * spec.track * curvature,
    )  # left, right if curvature > 0
    if len(spec.steering) == 1:
        left, right = angle, angle
    else:
        left = math.atan(spec.wheelbase * curvature / inner)
        right = math.atan(spec.wheelbase * curvature / outer)
    way = -1.0 if spec.steers_behind else 1.0
    return WheelTargets(speed * inner, speed * outer, way * left, way * right)


def bicycle_angle(wheels: list[float]) -> float:
    """Bicycle steering angle [rad] of one steered wheel, or of two, whose circles lie half a track beside its own."""
    slopes = [math.tan(wheel) for wheel in wheels]
    if min(slopes) * max(slopes) <= 0.0:  # ahead, or about to be
        return math.atan(sum(slopes) / len(slopes))
    return math.atan(len(slopes) / sum(1.0 / slope for slope in slopes))


def commanded_twist(spec: RobotSpec, command: Command) -> Twist:
    """Return the motion of the base that a command asks for, inside the robot's limits."""
    if isinstance(command, AckermannCommand):
        speed = _clip(command.speed, spec.max_speed)
        angle = _clip(command.steering_angle, spec.max_steering_angle)
        return Twist.planar(speed, 0.0, speed * math.tan(angle) / spec.wheelbase)
    if spec.drive is Drive.ACKERMANN:
        return commanded_twist(spec, AckermannCommand(command.vx, steering_angle(spec, command)))
    sideways = _clip(command.vy, spec.max_speed) if spec.drive is Drive.HOLONOMIC else 0.0
    return Twist.planar(_clip(command.vx, spec.max_speed), sideways, _clip(command.wz, spec.max_yaw_rate))


def twist_from_wheels(spec: RobotSpec, left: float, right: float, steering: float = 0.0) -> Twist:
    """Motion of the base if wheels turning at ``left`` and ``right`` [rad/s] do not slip, as odometry assumes."""
    speed = 0.5 * (left + right) * spec.wheel_radius
    if spec.drive is Drive.ACKERMANN:
        return Twist.planar(speed, 0.0, speed * math.tan(steering) / spec.wheelbase)
    return Twist.planar(speed, 0.0, (right - left) * spec.wheel_radius / (spec.track * spec.track_multiplier))
