"""From the action of a policy, numbers from -1 to 1, to a command."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry import Twist
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.physics.robot_models import Drive, RobotSpec


class CommandRange(ParameterModel):
    """What the actions -1 and 1 mean; 0 is to stand, in between it is linear."""

    max_vel_x: float = parameter(0.5, "Forward speed of the first action 1.", unit="m/s", gt=0.0, le=20.0)
    min_vel_x: float = parameter(-0.2, "Speed of the first action -1, backward.", unit="m/s", le=0.0, ge=-20.0)
    max_vel_theta: float = parameter(1.57, "Yaw rate of the second action 1; -1 is clockwise.", unit="rad/s", gt=0.0)
    max_vel_y: float = parameter(
        0.0, "Speed to the left of the third action 1; 0 = there is no third one.", unit="m/s", ge=0.0, le=20.0
    )

    @classmethod
    def of(cls, spec: RobotSpec) -> CommandRange:
        """Return what a robot can do."""
        sideways = spec.max_speed if spec.drive is Drive.HOLONOMIC else 0.0
        return cls(
            max_vel_x=spec.max_speed, min_vel_x=-spec.max_speed, max_vel_theta=spec.max_yaw_rate, max_vel_y=sideways
        )

    @property
    def size(self) -> int:
        """Length of an action."""
        return 3 if self.max_vel_y else 2

    def command(self, action: ArrayLike) -> Twist:
        """Return the command of an action (size,), clipped to -1 and 1.

        Raises
        ------
        ValueError
            The action has another shape, or is not finite.
        """
        try:
            values = np.asarray(action, dtype=np.float64)
        except (TypeError, ValueError):
            values = np.full(0, np.nan)
        if values.shape != (self.size,) or not np.isfinite(values).all():
            raise ValueError(f"action: expected {self.size} finite numbers from -1 to 1, got {action!r}")
        ahead, turn, *left = np.clip(values, -1.0, 1.0).tolist()
        speed = ahead * (self.max_vel_x if ahead > 0.0 else -self.min_vel_x)
        return Twist.planar(speed, left[0] * self.max_vel_y if left else 0.0, turn * self.max_vel_theta)
