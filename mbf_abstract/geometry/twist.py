"""Velocity commands: a twist, or speed and steering angle; finite by construction and stamped with their frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from mbf_abstract.geometry.rotations import Vector3, finite


@dataclass(frozen=True, slots=True)
class Twist:
    """Linear [m/s] and angular [rad/s] velocity, expressed in the robot's base frame; finite.

    Raises
    ------
    ValueError
        A component is not finite.
    """

    linear: Vector3 = (0.0, 0.0, 0.0)
    angular: Vector3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "linear", finite("linear", self.linear))
        object.__setattr__(self, "angular", finite("angular", self.angular))

    @classmethod
    def planar(cls, vx: float = 0.0, vy: float = 0.0, wz: float = 0.0) -> Twist:
        """Twist of a ground robot: forward and sideways speed [m/s], yaw rate [rad/s]."""
        return cls((vx, vy, 0.0), (0.0, 0.0, wz))

    @property
    def vx(self) -> float:
        """Forward speed [m/s]."""
        return self.linear[0]

    @property
    def vy(self) -> float:
        """Sideways speed, left positive [m/s]."""
        return self.linear[1]

    @property
    def wz(self) -> float:
        """Yaw rate, counter-clockwise positive [rad/s]."""
        return self.angular[2]

    @property
    def speed(self) -> float:
        """Length of the linear velocity [m/s]."""
        return math.hypot(*self.linear)

    def is_stopped(self, translation: float = 1e-3, rotation: float = 1e-3) -> bool:
        """Whether planar motion is within ``translation`` [m/s] per axis and ``rotation`` [rad/s]."""
        return abs(self.vx) <= translation and abs(self.vy) <= translation and abs(self.wz) <= rotation


@dataclass(frozen=True, slots=True)
class AckermannCommand:
    """Command of a car-like robot: ``speed`` [m/s] and front ``steering_angle`` [rad, left positive]; finite."""

    speed: float = 0.0
    steering_angle: float = 0.0

    def __post_init__(self) -> None:
        finite("speed", (self.speed,))
        finite("steering_angle", (self.steering_angle,))

    def is_stopped(self, translation: float = 1e-3, rotation: float = 1e-3) -> bool:
        """Whether the commanded speed is within ``translation`` [m/s]; a standing car may keep its wheels turned."""
        return abs(self.speed) <= translation


Command: TypeAlias = Twist | AckermannCommand
