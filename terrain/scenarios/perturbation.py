"""Small changes of a scenario, drawn from the seed of each run.

A scenario that succeeds only from one exact start, with one exact friction and a perfect pose, proves little. The block
``perturb:`` limits the changes; ``benchmarks/margins.py`` counts how many such runs still succeed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.places import FARTHEST, Place, PlanarPose

PERTURBATION_STREAM = 5  # of the run's seed; 1 to 4 belong to the world


class DrawnError(ConfigError):
    """What was drawn from a seed cannot be used; what is drawn from another one may be."""


class Perturbation(ParameterModel):
    """What may differ from the scenario as written; zero everywhere = nothing."""

    start_position: float = parameter(
        0.0, "Largest shift of the start along x, and along y; drawn.", unit="m", ge=0.0, le=FARTHEST
    )
    start_yaw: float = parameter(0.0, "Largest turn of the start; drawn.", unit="deg", ge=0.0, le=180.0)
    friction: float = parameter(
        0.0, "Largest relative change of the friction of the wheels; drawn, without effect without physics.", ge=0, lt=1
    )
    mass: float = parameter(
        0.0, "Largest relative change of the robot's mass; drawn, without effect without physics.", ge=0.0, lt=1.0
    )
    range_noise: float = parameter(
        0.0, "Standard deviation added to every range of a lidar.", unit="m", ge=0.0, le=FARTHEST
    )
    pose_position: float = parameter(
        0.0, "Standard deviation added to x, y and z of the pose.", unit="m", ge=0.0, le=FARTHEST
    )
    pose_angle: float = parameter(0.0, "Standard deviation added to its angles.", unit="deg", ge=0.0, lt=45.0)
    command_delay: float = parameter(0.0, "How late each command reaches the motors.", unit="s", ge=0.0, le=1.0)


@dataclass(frozen=True)
class Disturbance:
    """What one run has drawn.

    Attributes
    ----------
    dx, dy, dyaw : float
        Shift [m] and turn [rad] of the start.
    friction, mass : float
        Factors of the wheels' friction and of the robot's mass.
    """

    dx: float = 0.0
    dy: float = 0.0
    dyaw: float = 0.0
    friction: float = 1.0
    mass: float = 1.0

    def moved(self, place: Place, pose_of: Callable[[Place], Pose]) -> Pose:
        """Return the pose of a start after shift and turn; coordinates without a height stay on the ground.

        Raises DrawnError where the shift leads off the ground, ConfigError where the start itself is off it.
        """
        if isinstance(place, str):
            named = pose_of(place)
            place = PlanarPose(x=named.x, y=named.y, yaw=named.yaw, z=named.z)
        moved = {"x": place.x + self.dx, "y": place.y + self.dy, "yaw": place.yaw + self.dyaw}
        pose_of(place)
        try:
            return pose_of(place.model_copy(update=moved))
        except ConfigError as error:
            raise DrawnError(error.findings) from error


def draw_disturbance(perturb: Perturbation, seed: int) -> Disturbance:
    """Draw what is different in the run with this seed; every kind has its own draw, so that one shifts no other."""
    rng = np.random.default_rng([seed, PERTURBATION_STREAM])
    dx, dy, dyaw, friction, mass = rng.uniform(-1.0, 1.0, size=5).tolist()
    return Disturbance(
        dx * perturb.start_position,
        dy * perturb.start_position,
        dyaw * math.radians(perturb.start_yaw),
        1.0 + friction * perturb.friction,
        1.0 + mass * perturb.mass,
    )
