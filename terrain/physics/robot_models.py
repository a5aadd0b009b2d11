"""The robots that can be simulated, as data: sizes, limits, wheels. One constant each, and a table by name.

``HUSKY`` is for rough ground, ``TURTLEBOT`` for buildings, ``CAR`` for planners and controllers that must respect a
turning circle. Sizes and limits follow the makers' published figures (Husky A200, TurtleBot 2); the bodies in
``terrain/urdf`` are our own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import norm

URDF_FOLDER = Path(__file__).resolve().parents[1] / "urdf"


class Drive(Enum):
    """How wheels make the robot move."""

    SKID_STEER = "skid_steer"
    DIFFERENTIAL = "differential"
    ACKERMANN = "ackermann"
    HOLONOMIC = "holonomic"


@dataclass(frozen=True)
class RobotSpec:
    """What worlds, planners and controllers need to know of a robot.

    Attributes
    ----------
    footprint : tuple of (float, float)
        Corners of the outline [m] in base_link, counter-clockwise.
    left_wheels, right_wheels : tuple of str
        Driven joints.
    steering : tuple of str
        Left and right steering joint of a car, or that of its single steered wheel; else empty.
    steers_behind : bool
        Whether a car's steered wheels lie behind its other axle, as those of a forklift: they turn the other way.
    track, wheelbase : float
        Distance between left and right wheels, and between axles [m]; wheelbase 0 for a single axle.
    track_multiplier : float
        A skid-steered robot turns as if its track were this much wider, because its wheels scrub.
    max_speed, max_yaw_rate, max_acceleration, max_yaw_acceleration : float
        [m/s], [rad/s], [m/s2], [rad/s2].
    max_steering_angle : float
        Of a car [rad].
    wheel_friction : tuple of 3 floats
        Factors along the wheel's x, axle and z; less along the axle lets skid-steered wheels scrub predictably.
    motor_torque : float
        Limit of each driven wheel [N m].
    lidar_position : tuple of 3 floats
        Of the scanner in base_link [m].
    wheel_positions : tuple of (float, float, float)
        Centres of the wheels in base_link [m]; empty where track and wheelbase say it.
    file : Path, optional
        URDF of the body, of a robot that does not ship.
    """

    name: str
    drive: Drive
    footprint: tuple[tuple[float, float], ...]
    height: float
    mass: float
    wheel_radius: float
    track: float
    wheelbase: float
    left_wheels: tuple[str, ...]
    right_wheels: tuple[str, ...]
    max_speed: float
    max_yaw_rate: float
    max_acceleration: float
    max_yaw_acceleration: float
    motor_torque: float
    lidar_position: tuple[float, float, float]
    steering: tuple[str, ...] = ()
    steers_behind: bool = False
    max_steering_angle: float = 0.0
    track_multiplier: float = 1.0
    wheel_friction: tuple[float, float, float] = (1.0, 1.0, 1.0)
    wheel_positions: tuple[tuple[float, float, float], ...] = ()
    file: Path | None = None

    @property
    def urdf(self) -> Path:
        """File of the body."""
        return self.file or URDF_FOLDER / f"{self.name}.urdf"

    @cached_property
    def circumscribed_radius(self) -> float:
        """Radius [m] of the smallest circle about base_link around the footprint."""
        return float(norm(np.array(self.footprint)).max())

    @property
    def min_turning_radius(self) -> float:
        """Radius [m] of the tightest circle of the base; 0 for robots that turn on the spot."""
        return self.wheelbase / math.tan(self.max_steering_angle) if self.drive is Drive.ACKERMANN else 0.0

    def footprint_array(self) -> NDArray[np.float64]:
        """Footprint as (n, 2) float64 [m]."""
        return np.array(self.footprint, dtype=np.float64)


def rectangle(x_min: float, x_max: float, half_width: float) -> tuple[tuple[float, float], ...]:
    """Footprint [m] from behind to before the base, symmetric to its axis."""
    return ((x_min, -half_width), (x_max, -half_width), (x_max, half_width), (x_min, half_width))


def _circle(radius: float) -> tuple[tuple[float, float], ...]:
    """Polygon of 16 corners around a circle, so that no part of the robot sticks out."""
    outer = radius / math.cos(math.pi / 16)
    angles = [2.0 * math.pi * (k + 0.5) / 16 for k in range(16)]
    return tuple((outer * math.cos(angle), outer * math.sin(angle)) for angle in angles)


HUSKY = RobotSpec(
    name="husky",
    drive=Drive.SKID_STEER,
    footprint=rectangle(-0.50, 0.50, 0.345),
    height=0.37,
    mass=43.9,
    wheel_radius=0.178,
    track=0.5708,
    track_multiplier=1.28,
    wheelbase=0.512,
    left_wheels=("front_left", "rear_left"),
    right_wheels=("front_right", "rear_right"),
    max_speed=1.0,
    max_yaw_rate=2.0,
    max_acceleration=3.0,
    max_yaw_acceleration=6.0,
    motor_torque=40.0,
    wheel_friction=(1.0, 0.5, 1.0),
    lidar_position=(0.1, 0.0, 0.55),
)

TURTLEBOT = RobotSpec(
    name="turtlebot",
    drive=Drive.DIFFERENTIAL,
    footprint=_circle(0.18),
    height=0.41,
    mass=6.3,
    wheel_radius=0.038,
    track=0.23,
    wheelbase=0.0,
    left_wheels=("left",),
    right_wheels=("right",),
    max_speed=0.65,
    max_yaw_rate=1.9,
    max_acceleration=1.5,
    max_yaw_acceleration=4.0,
    motor_torque=2.0,
    lidar_position=(0.0, 0.0, 0.30),
)

CAR = RobotSpec(
    name="car",
    drive=Drive.ACKERMANN,
    footprint=rectangle(-0.17, 0.75, 0.29),
    height=0.30,
    mass=27.6,
    wheel_radius=0.13,
    track=0.49,
    wheelbase=0.58,
    left_wheels=("rear_left",),
    right_wheels=("rear_right",),
    steering=("left_steering", "right_steering"),
    max_steering_angle=0.5,
    max_speed=1.5,
    max_yaw_rate=1.4,
    max_acceleration=2.0,
    max_yaw_acceleration=4.0,
    motor_torque=25.0,
    lidar_position=(0.58, 0.0, 0.40),
)

ROBOTS = {spec.name: spec for spec in (HUSKY, TURTLEBOT, CAR)}
