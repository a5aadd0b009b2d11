"""Tilt: roll and pitch of the robot's own footprint on the surface, for 16 headings.

When to use: slopes near the robot's limits. It may drive straight up what it must not cross sideways, and it does not
fall into a ditch narrower than its wheelbase that ``steepness`` forbids. When not: flat floors, tracked or legged
robots, and meshes coarser than half the footprint. It replaces the guard of the border: where a wheel has no support,
the heading is not allowed. Planners that know no headings look for a path that comes with allowed ones, a bounded
number of times. ``preferred_headings`` keeps them to ground that allows most: elsewhere the cost is 1, which a planner
that looks at headings enters with a higher ``cost_limit``. ``needed_headings`` closes such ground to all planners.
Rule: the four wheels stand on the surface, the body takes their plane of least squares (``footprint_settling``); a
``rigid`` one stands on three of them, which on a skew ledge is some degrees steeper, and counts the worse stance. A
heading is allowed if roll, pitch up and pitch down keep their limits, the slope in every direction stays
``tip_over_margin`` below the angle at which the centre of mass leaves the wheels, and no vertex inside the footprint
comes higher than the belly. Wheel positions are taken in the plan view. On a map whose heights have an error, each
limit is lower by what the slope between two wheels may be wrong, and what is below the belly counts as higher by 1.5
errors, as the highest of many wrong heights is. Where the map states the errors of each vertex, limits count with those
of the places under the wheels, the belly with that of each vertex below it.
Cost: about 10 microseconds a vertex, 144 bytes a vertex.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import model_validator

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import BoolArray, Float32Array
from mbf_mesh_nav.kernels.layers.footprint_settling import settle_footprints, wheel_directions
from mbf_mesh_nav.kernels.layers.wheel_errors import errors_below_wheels
from mbf_mesh_nav.map.height_error import (
    Errors,
    HeightErrorParameters,
    errors_for,
    narrowed,
    place_errors_for,
    slope_error,
    usual_error,
)
from mbf_mesh_nav.map.layer import CostArray, LayerContext, LethalArray, MeshLayer

HEADINGS = 16
LEAST_LIMIT = 1e-3
"""Least limit [rad] that is left, however large margin and error are."""
BELLY_ERRORS = 1.5
"""Standard errors by which ground below the belly may be higher than on the map.

The belly strikes the highest of the places below it, some nine vertices of a built map below a robot of 0.5 m; the
greatest of nine independent normal errors is 1.49 of them on average (Harter, Biometrika 48, 1961). The plane of the
wheels is a mean of four, whose error would add a twentieth and is left out.
"""


class TiltParameters(HeightErrorParameters):
    """Parameters of ``tilt``."""

    wheelbase: float = parameter(0.5, "Distance of the front from the rear wheels.", unit="m", gt=0.0, le=10.0)
    track: float = parameter(0.4, "Distance of the left from the right wheels.", unit="m", gt=0.0, le=10.0)
    rigid: bool = parameter(
        False, "Whether no axle can swing and no spring gives: on an uneven surface the robot stands on three wheels."
    )
    max_roll: float = parameter(0.3, "Greatest slope across the heading.", unit="rad", gt=0.0, lt=1.57)
    max_pitch_up: float = parameter(0.45, "Greatest slope to climb.", unit="rad", gt=0.0, lt=1.57)
    max_pitch_down: float = parameter(0.45, "Greatest slope to descend.", unit="rad", gt=0.0, lt=1.57)
    center_of_mass_height: float = parameter(0.2, "Height of the centre of mass above the ground.", unit="m", ge=0.0)
    center_of_mass_x: float = parameter(0.0, "Centre of mass ahead of the middle of the wheels.", unit="m")
    tip_over_margin: float = parameter(0.15, "Angle to keep from tipping over.", unit="rad", ge=0.0)
    ground_clearance: float = parameter(
        0.1, "Height of the belly above the ground; .inf = do not check.", unit="m", gt=0.0, allow_inf=True
    )
    needed_headings: float = parameter(
        0.0, "Ground that allows a smaller share of headings is lethal; 0 = any one will do, 1 = all.", ge=0.0, le=1.0
    )
    preferred_headings: float = parameter(
        0.0, "Ground that allows a smaller share of headings costs 1; no effect below needed_headings.", ge=0.0, le=1.0
    )

    @model_validator(mode="after")
    def _stands_on_its_wheels(self) -> TiltParameters:
        if abs(self.center_of_mass_x) >= self.wheelbase / 2.0:
            raise ValueError(
                f"a centre of mass between the wheels; center_of_mass_x {self.center_of_mass_x:g} m is not between the "
                f"wheels of a wheelbase of {self.wheelbase:g} m: the robot would tip over on flat ground"
            )
        return self


class TiltLayer(MeshLayer):
    """Which headings are allowed at which vertex.

    Attributes
    ----------
    roll, pitch : (V, 16) float32
        Angles [rad] at heading ``2 pi h / 16``, left side up and nose up positive, inf where a wheel has no support.
    allowed : (V, 16) bool
        Whether the robot may stand there with that heading.
    """

    Parameters = TiltParameters
    parameters: TiltParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        shape = (context.topology.vertex_count, HEADINGS)
        self.roll: Float32Array = np.zeros(shape, dtype=np.float32)
        self.pitch: Float32Array = np.zeros(shape, dtype=np.float32)
        self.allowed: BoolArray = np.ones(shape, dtype=np.bool_)
        self._too_few_as_measured: BoolArray = np.zeros(shape[0], dtype=np.bool_)

    @property
    def lethal_for_good(self) -> LethalArray:
        """Where fewer headings than needed are allowed on the map as it is."""
        return self._too_few_as_measured

    def lethal_reason(self, vertex: int) -> str:
        """How many headings are allowed and needed, and the error of the heights that the limits are narrowed by."""
        needed, errors = _count_of(self.parameters.needed_headings), errors_for(self)
        error = errors if isinstance(errors, float) else float(errors[vertex])
        narrowed = f", with an error of the heights of {error:.3f} m" if error > 0.0 else ""
        return f"{np.count_nonzero(self.allowed[vertex])} of {HEADINGS} headings are allowed, {needed} needed{narrowed}"

    @classmethod
    def reach(cls, parameters: TiltParameters) -> float:
        """From the middle of the robot to its wheels, and as far again for what lies between them."""
        return parameters.wheelbase + parameters.track

    def compute(self) -> tuple[CostArray, LethalArray]:
        """Cost = share of the limits that the best headings use, as many as preferred; 1 where too few are allowed.

        Lethal where fewer are allowed than needed. The error of the map narrows what is allowed, not the preference.
        """
        settings, surface = self.parameters, self.topology.surface
        directions = wheel_directions(HEADINGS, settings.wheelbase, settings.track)
        errors, count = place_errors_for(self), self.topology.vertex_count
        margins = np.broadcast_to(BELLY_ERRORS * np.asarray(errors_for(self), dtype=np.float64), (count,))
        self.roll, self.pitch, bump, raised = settle_footprints(
            surface, *directions, settings.wheelbase, settings.track, settings.rigid, np.ascontiguousarray(margins)
        )
        if not isinstance(errors, float):
            radius = 0.5 * float(np.hypot(settings.wheelbase, settings.track))
            errors = errors_below_wheels(surface, *directions, radius, errors).astype(np.float64)
        self.allowed = (self._usage(self._limits(errors)) <= 1.0) & (raised < settings.ground_clearance)
        needed = _count_of(settings.needed_headings)
        last = max(needed, _count_of(settings.preferred_headings)) - 1
        usage = self._usage(self.limits_as_measured())
        as_measured = (usage <= 1.0) & (bump < settings.ground_clearance)
        ranked = np.partition(np.where(as_measured, usage, np.inf), last, axis=1)[:, last]
        self._too_few_as_measured = np.count_nonzero(as_measured, axis=1) < needed
        lethal = np.count_nonzero(self.allowed, axis=1) < needed
        return np.where(np.isinf(ranked), 1.0, ranked).astype(np.float32), lethal

    def _usage(self, limits: tuple[Errors, Errors, Errors]) -> Float32Array:
        """Greatest ratio (V, 16) of an angle to its limit."""
        roll_limit, up_limit, down_limit = limits
        sideways = np.abs(self.roll) / roll_limit
        return np.asarray(np.maximum(sideways, np.maximum(self.pitch / up_limit, -self.pitch / down_limit)))

    def limits(self) -> tuple[float, float, float]:
        """Return the limits of roll, pitch up and pitch down [rad] less the usual error of the map, at least 1e-3."""
        roll, up, down = (float(limit) for limit in self._limits(usual_error(place_errors_for(self))))
        return roll, up, down

    @property
    def room_below(self) -> float:
        """The ground clearance less what the ground below may be higher by the usual error of the map [m]."""
        return self.parameters.ground_clearance - BELLY_ERRORS * usual_error(errors_for(self))

    def _limits(self, errors: Errors) -> tuple[Errors, Errors, Errors]:
        """Limits [rad] for standard errors of the heights under the wheels [m], at least 1e-3."""
        roll_limit, up_limit, down_limit = self.limits_as_measured()
        across, along = (slope_error(errors, length) for length in (self.parameters.track, self.parameters.wheelbase))
        pairs = ((roll_limit, across), (up_limit, along), (down_limit, along))
        roll, up, down = (narrowed(limit, error, LEAST_LIMIT) for limit, error in pairs)
        return roll, up, down

    def limits_as_measured(self) -> tuple[float, float, float]:
        """Return the limits of roll, pitch up and pitch down [rad] on an exact map, the tip-over margin included."""
        settings = self.parameters
        height = settings.center_of_mass_height
        lever_arms = (
            0.5 * settings.track,
            0.5 * settings.wheelbase + settings.center_of_mass_x,
            0.5 * settings.wheelbase - settings.center_of_mass_x,
        )
        configured = (settings.max_roll, settings.max_pitch_up, settings.max_pitch_down)
        steady = [math.atan2(lever_arm, height) - settings.tip_over_margin for lever_arm in lever_arms]
        roll, up, down = (max(min(pair), LEAST_LIMIT) for pair in zip(configured, steady, strict=True))
        return roll, up, down


def _count_of(share: float) -> int:
    """How many headings a share of them is, at least one."""
    return max(1, math.ceil(share * HEADINGS))


def heading_index(yaw: float) -> int:
    """Index 0..15 of the heading nearest to ``yaw`` [rad]."""
    return round(yaw * HEADINGS / (2.0 * np.pi)) % HEADINGS
