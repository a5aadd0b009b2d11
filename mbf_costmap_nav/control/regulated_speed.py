"""How fast a regulated pure pursuit drives and turns, and how far it looks ahead; its parameters.

Formula: regulation by curvature, by proximity and by approach (Macenski, Singh, Martin, Gines 2023, eq. 4 to 7) with
Nav2's parameter meanings.
"""

from __future__ import annotations

import math
from typing import ClassVar

from mbf_abstract.maps.controllers.braking import BrakesOnItsArc
from mbf_abstract.maps.controllers.inertia import InertiaParameters, stopping_speed
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.control.path_handling import PathFollower
from mbf_costmap_nav.grid.costmap import FREE, INSCRIBED
from mbf_costmap_nav.grid.footprint import Footprint

USUAL_PERIOD = 0.05  # s
DEFAULT_DECAY, LEAST_DECAY = 10.0, 1e-3
"""1/m: of a map without an inflation layer, and of one whose costs do not fall at all."""


class RegulatedPurePursuitParameters(PluginParameters):
    """Parameters of ``costmap.regulated_pure_pursuit``."""

    max_vel_x: float = parameter(0.5, "Speed on a free straight path.", unit="m/s", gt=0.0, le=20.0)
    acc_lim_x: float = parameter(2.5, "Largest change of speed.", unit="m/s^2", gt=0.0, le=100.0)
    look_ahead_dist: float = parameter(0.6, "Carrot distance if it is fixed.", unit="m", gt=0.0, le=20.0)
    use_velocity_scaled_look_ahead: bool = parameter(True, "Let the carrot distance grow with speed.")
    look_ahead_time: float = parameter(1.5, "Carrot distance per speed.", unit="s", gt=0.0, le=20.0)
    min_look_ahead_dist: float = parameter(0.3, "Least scaled carrot distance.", unit="m", gt=0.0, le=20.0)
    max_look_ahead_dist: float = parameter(0.9, "Largest scaled carrot distance.", unit="m", gt=0.0, le=20.0)
    regulated_min_radius: float = parameter(0.9, "Tighter curves slow down; 0 = off.", unit="m", ge=0.0, le=20.0)
    regulated_min_speed: float = parameter(0.25, "Regulation never slows below this.", unit="m/s", ge=0.0, le=20.0)
    cost_scaling_dist: float = parameter(
        0.6, "Obstacles nearer than this slow down; 0 = off.", unit="m", ge=0.0, le=20.0
    )
    cost_scaling_gain: float = parameter(1.0, "Factor on the obstacle slow-down.", gt=0.0, le=1.0)
    inflation_cost_scaling_factor: float | None = parameter(
        None,
        "Decay that turns costs into distances; absent = that of the costmap's inflation layer.",
        unit="1/m",
        gt=0.0,
        le=1000.0,
    )
    approach_dist: float = parameter(0.6, "Slow down over this length before the end.", unit="m", ge=0.0, le=20.0)
    min_approach_vel: float = parameter(0.05, "Speed at the end of the approach.", unit="m/s", gt=0.0, le=5.0)
    rotate_to_heading: bool = parameter(True, "Turn in place to the path and at the goal; a car never does.")
    rotate_to_heading_min_angle: float = parameter(
        0.785, "Turn in place if the carrot is further off than this.", unit="rad", gt=0.0, le=3.2
    )
    rotate_to_heading_vel: float = parameter(1.8, "Yaw rate of turning in place.", unit="rad/s", gt=0.0, le=20.0)
    max_vel_theta: float = parameter(1.8, "Largest yaw rate while driving.", unit="rad/s", gt=0.0, le=20.0)
    min_turning_radius: float | None = parameter(
        None, "Radius of the tightest arc; 0 = any, absent = the robot's.", unit="m", ge=0.0, le=100.0
    )
    acc_lim_theta: float = parameter(3.2, "Change of the yaw rate in place.", unit="rad/s^2", gt=0.0, le=100.0)
    allow_reversing: bool = parameter(True, "Drive backward where the poses of the path look against its direction.")
    max_path_distance: float = parameter(
        1.5, "Farther from the path than this it is missed.", unit="m", gt=0.0, le=100.0
    )
    collision_check: bool = parameter(True, "Simulate the footprint ahead along the arc.")
    check_ahead_time: float = parameter(
        1.0, "How far ahead the motion must be free.", unit="s", was="collision_check_time", gt=0.0, le=10.0
    )
    min_distance_to_obstacle: float = parameter(
        0.0,
        "Least length ahead that is checked at low speed; 0 = only what the check time covers.",
        unit="m",
        ge=0.0,
        le=2.0,
    )
    collision_check_padding: float | None = parameter(
        None, "Padding of the footprint in that simulation; absent = the costmap's.", unit="m", ge=0.0, le=1.0
    )
    make_room_dist: float = parameter(
        0.5,
        "How far it may drive on in a wider curve where turning would swing the outline into something; 0 = it stops.",
        unit="m",
        ge=0.0,
        le=10.0,
    )
    control_period: float | None = parameter(
        None,
        "Time between two calls; stated, no command changes by more until the next. Absent = 0.05 s, for speeds only.",
        unit="s",
        gt=0.0,
        le=1.0,
    )

    @property
    def period(self) -> float:
        """Time between two calls [s], as stated or usual."""
        return self.control_period or USUAL_PERIOD


class RegulatedFollower(BrakesOnItsArc, PathFollower):
    """Base of a controller with regulated speeds."""

    Parameters: ClassVar[type[PluginParameters]] = RegulatedPurePursuitParameters
    parameters: RegulatedPurePursuitParameters
    _outline: tuple[Footprint, Footprint] | None = None
    """The costmap's outline without padding, and the one used by the collision check."""

    def parameters_changed(self) -> None:
        """Drop the outline with the old padding."""
        self._outline = None

    @property
    def known_inertia(self) -> InertiaParameters:
        """What its speeds are planned with."""
        p = self.parameters
        return InertiaParameters(acc_lim_x=p.acc_lim_x, acc_lim_theta=p.acc_lim_theta, control_period=p.period)

    @property
    def inertia(self) -> InertiaParameters:
        """The same for a robot whose control period is stated; others follow at once."""
        return InertiaParameters() if self.parameters.control_period is None else self.known_inertia

    def checked_footprint(self) -> Footprint:
        """The costmap's outline, with the padding of the collision check where one is given."""
        padding, bare = self.parameters.collision_check_padding, self.costmap.unpadded_footprint
        if padding is None:
            return self.costmap.footprint
        if self._outline is None or self._outline[0] is not bare:
            self._outline = bare, bare.padded(padding)
        return self._outline[1]

    @property
    def full_speed(self) -> float:
        """Speed [m/s] on a free straight path."""
        return self.parameters.max_vel_x

    @property
    def turning_radius(self) -> float:
        """Radius [m] of the tightest arc, as configured or the robot's; 0 = any."""
        given = self.parameters.min_turning_radius
        return self.min_turning_radius if given is None else given

    @property
    def rotates(self) -> bool:
        """Whether it turns in place to the path and at the goal."""
        return self.parameters.rotate_to_heading and self.turning_radius == 0.0

    @property
    def decay(self) -> float:
        """Rate [1/m] at which costs fall with distance: as configured, or as the map's last inflation layer has it."""
        if (given := self.parameters.inflation_cost_scaling_factor) is not None:
            return given
        layers = (layer.parameters for layer in self.costmap.layers.values() if layer.parameters.enabled)
        factors = [float(p.cost_scaling_factor) for p in layers if hasattr(p, "cost_scaling_factor")]
        return max(factors[-1], LEAST_DECAY) if factors else DEFAULT_DECAY

    def look_ahead_distance(self, speed: float) -> float:
        """Carrot distance [m] at a speed [m/s]."""
        p = self.parameters
        if not p.use_velocity_scaled_look_ahead:
            return p.look_ahead_dist
        return min(max(abs(speed) * p.look_ahead_time, p.min_look_ahead_dist), p.max_look_ahead_dist)

    def rotation_speed(self, angle: float, speed: float) -> float:
        """Yaw rate [rad/s] that turns by ``angle`` [rad] and can still brake in time, from the present ``speed``."""
        p = self.parameters
        change = p.acc_lim_theta * p.period
        wanted = math.copysign(p.rotate_to_heading_vel, angle)
        reachable = min(max(wanted, speed - change), speed + change)
        reaction_time = 0.0 if p.control_period is None else p.control_period
        braking = stopping_speed(abs(angle), p.acc_lim_theta, reaction_time)
        return min(max(reachable, -braking), braking)

    def regulated_speed(self, curvature: float, cost: int, remaining: float) -> float:
        """Speed [m/s] for a curvature [1/m], the cost under the robot, and the length left [m]."""
        p = self.parameters
        in_curve = near_obstacle = p.max_vel_x
        if p.regulated_min_radius > 0.0 and abs(curvature) * p.regulated_min_radius > 1.0:
            in_curve *= 1.0 / (abs(curvature) * p.regulated_min_radius)
        if p.cost_scaling_dist > 0.0 and FREE < cost <= INSCRIBED:
            clearance = self.costmap.inscribed_radius - math.log(cost / (INSCRIBED - 1)) / self.decay
            if clearance < p.cost_scaling_dist:
                near_obstacle *= p.cost_scaling_gain * max(clearance, 0.0) / p.cost_scaling_dist
        speed = max(min(in_curve, near_obstacle), min(p.regulated_min_speed, p.max_vel_x))
        if remaining < p.approach_dist:
            speed = min(speed, max(speed * remaining / p.approach_dist, p.min_approach_vel))
        return speed
