"""``RobotDescription``: all that navigation and simulation need to know of a robot, see ``describe``.

Lengths are in ``base_link`` as navigation has it: on the ground, x ahead; in the middle of the wheels, of a car in the
middle of those that are not steered; below the root link of a robot on legs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mbf_abstract.geometry import FloatArray
from terrain.description.outline import Corner
from terrain.description.parameters import DriveName, UrdfRobot
from terrain.description.running_gear import RunningGear
from terrain.description.stability import Edges, Tipping
from terrain.description.urdf import Urdf, link_frames


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """A robot, as described by its URDF and by what the user states.

    Attributes
    ----------
    gear : RunningGear
        Wheels and supports, in the root link.
    p_root_base : (3,) float64
        Where ``base_link`` is in the root link [m]; their axes are parallel.
    footprint : list of (float, float)
        Convex outline [m], counter-clockwise.
    height, ground_clearance : float
        Of the top and of the belly above the ground [m].
    mass : float
        [kg]
    center_of_mass : tuple of 3 floats
        In ``base_link`` [m].
    wheel_radius, wheelbase, track : float
        [m]; wheelbase is 0 for a single axle, all are 0 on legs.
    contacts : (n, 2) float64
        Where it stands on wheels, casters and other supports [m].
    tipping : Tipping or None
        Slopes at which it tips over; None for a robot that stands on one line, and on legs.
    edges : Edges or None
        Ramps and crests it clears, likewise.
    notes : tuple of str
        What was assumed or is odd.
    """

    urdf: Urdf
    stated: UrdfRobot
    gear: RunningGear
    p_root_base: FloatArray
    footprint: list[Corner]
    height: float
    ground_clearance: float
    mass: float
    center_of_mass: tuple[float, float, float]
    wheel_radius: float
    wheelbase: float
    track: float
    max_speed: float
    max_yaw_rate: float
    max_steering_angle: float
    motor_torque: float
    track_multiplier: float
    contacts: FloatArray
    tipping: Tipping | None
    edges: Edges | None
    notes: tuple[str, ...]

    @property
    def drive(self) -> DriveName:
        """How it moves."""
        return self.gear.drive

    @property
    def min_turning_radius(self) -> float:
        """Radius [m] of the tightest circle of the base; 0 for a robot that turns on the spot."""
        return self.wheelbase / math.tan(self.max_steering_angle) if self.drive == "ackermann" else 0.0

    def solids_by_link(self) -> list[tuple[str, FloatArray]]:
        """Link and points (n, 3) [m] in ``base_link`` of every collision shape."""
        frames = link_frames(self.urdf)
        return [
            (name, shape.within(frames[name]).points() - self.p_root_base)
            for name, link in self.urdf.links.items()
            for shape in link.shapes
        ]
