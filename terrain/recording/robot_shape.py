"""What a simulated robot looks like in pictures: its outline, height and wheels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbf_abstract.geometry import FloatArray
from terrain.physics.robot_models import Drive, RobotSpec


@dataclass(frozen=True, eq=False)
class RobotShape:
    """What a robot looks like, roughly: a body and wheels in base_link.

    Attributes
    ----------
    footprint : (n, 2) float64
        Outline [m], counter-clockwise.
    height, wheel_radius : float
        [m]
    wheels : (k, 3) float64
        Centres of the wheels [m].
    """

    name: str
    footprint: FloatArray
    height: float
    wheels: FloatArray
    wheel_radius: float

    @classmethod
    def of(cls, spec: RobotSpec) -> RobotShape:
        """Shape of one of the simulated robots."""
        return cls(spec.name, spec.footprint_array(), spec.height, _wheel_positions(spec), spec.wheel_radius)


def _wheel_positions(spec: RobotSpec) -> FloatArray:
    """Centres (k, 3) of the wheels in base_link, which lies under the rear axle of a car and amidships else."""
    if spec.wheel_positions or spec.drive is Drive.HOLONOMIC:
        return np.array(spec.wheel_positions, dtype=np.float64).reshape(-1, 3)
    axles = {
        Drive.ACKERMANN: (0.0, spec.wheelbase),
        Drive.SKID_STEER: (-0.5 * spec.wheelbase, 0.5 * spec.wheelbase),
        Drive.DIFFERENTIAL: (0.0,),
    }[spec.drive]
    return np.array([(x, side * spec.track / 2, spec.wheel_radius) for x in axles for side in (1.0, -1.0)])
