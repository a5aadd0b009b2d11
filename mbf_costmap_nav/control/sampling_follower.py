"""The base of controllers that sample motions: where they keep to their path, and when they give up.

The rule is that of ``mbf_abstract.maps.controllers.keeping_to_path``, shared with the meshes.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace
from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray, Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.inertia import PLANNED, InertiaParameters, stopping_speed
from mbf_abstract.maps.controllers.keeping_to_path import KeepingToPath
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.maps.controllers.room_to_turn import CREEPING
from mbf_abstract.maps.controllers.standing import StandingParameters
from mbf_abstract.maps.controllers.tight_places import cannot_turn_ahead
from mbf_abstract.maps.tracking.avoidance import AvoidanceParameters, MovingAround
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_costmap_nav.control.path_handling import ControlCycle, PathFollower
from mbf_costmap_nav.control.trajectory_scoring import brakes_free, stops_free
from mbf_costmap_nav.grid.costmap import INSCRIBED, UNKNOWN
from mbf_costmap_nav.plugins import CostmapContext

LOOK, LOOK_STEP = 0.5, 0.1  # s
AHEAD = 2.0
"""A place where the robot cannot turn counts so many radii of its outline ahead; for a car, a quarter circle more."""


class SamplingParameters(PluginParameters):
    """What all controllers that sample motions have."""

    max_path_distance: float = parameter(2.0, "A path farther away is missed.", unit="m", gt=0.0, le=100.0)
    check_ahead_time: float = parameter(
        1.0, "How far ahead the whole footprint must be free.", unit="s", was="footprint_check_time", ge=0.0, le=10.0
    )
    moving_objects: AvoidanceParameters = parameter(AvoidanceParameters(), "How it keeps away from what moves.")
    standing: StandingParameters = parameter(StandingParameters(), "What it does where its motions get it nowhere.")


class SamplingFollower(PathFollower):
    """A controller whose ``sampled`` is one cycle of it."""

    leaves_contacts = True
    parameters: Any  # those of a controller, with ``standing`` and ``moving_objects``
    _brakes_by = InertiaParameters()

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._keeping = KeepingToPath(context)

    @property
    def is_leaving(self) -> bool:
        """Whether the robot is leaving a contact."""
        return self._keeping.is_leaving

    @property
    def turning_radius(self) -> float:
        """Radius [m] of the tightest curve of a car; 0 = the robot turns on the spot."""
        return 0.0

    @abstractmethod
    def limits(self, cycle: ControlCycle) -> MotionLimits:
        """What it may command in this cycle."""

    @abstractmethod
    def sampled(self, cycle: ControlCycle, around: MovingAround) -> ControlResult:
        """The best of the sampled motions."""

    def keep_with(self, period: float, horizon: float, *, brakes: bool) -> None:
        """Keep to the path with the limits of the parameters, and a ``period`` [s] between two calls.

        A robot that ``brakes`` does so along its arc where no motion is free any more; others are stopped by zero. It
        turns to its path by itself where that takes longer than the ``horizon`` [s] of the samples.
        """
        p = self.parameters
        inertia = InertiaParameters(acc_lim_x=p.acc_lim_x, acc_lim_theta=p.acc_lim_theta, control_period=period)
        slowest = {"acc_lim_x": min(p.acc_lim_x, p.acc_lim_y)}
        self._brakes_by = inertia.model_copy(update=slowest) if brakes else InertiaParameters()
        reverses = p.min_vel_x < 0.0
        limits, seen = (p.max_vel_x, p.max_vel_theta, inertia, self._brakes_by), horizon if brakes else math.inf
        self._keeping.drive_with(*limits, allow_reversing=reverses, horizon=seen)

    def stops(self, cycle: ControlCycle, velocity: FloatArray, braking: FloatArray, dt: float) -> bool:
        """Whether the robot touches nothing until it stands if no motion is free any more; see ``stops_free``."""
        if self._brakes_by.acc_lim_x < math.inf:
            return brakes_free(cycle, velocity, self._brakes_by)
        return stops_free(cycle, velocity, braking, dt, self.parameters.check_ahead_time)

    def set_plan(self, path: Path) -> bool:
        """Take over a path."""
        accepted = super().set_plan(path)
        if accepted:
            self._keeping.set_plan(path)
        return accepted

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """As for all; whoever keeps to the path needs the tolerances, too."""
        reached = self._keeping.update(pose, dist_tolerance, angle_tolerance)
        return super().is_goal_reached(pose, dist_tolerance, angle_tolerance) or reached

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Sample, or keep to the path."""
        cycle = self.begin_cycle(request)
        if isinstance(cycle, ControlResult):
            return cycle
        assert self.tracker is not None
        p = self.parameters
        stopping = stopping_speed(cycle.tracker.to_cusp, PLANNED * p.acc_lim_x), 2.0 * p.acc_lim_x * p.check_ahead_time
        cycle = replace(cycle, speed_limit=min(cycle.speed_limit, max(min(stopping), CREEPING)))
        around = MovingAround.on(self.navigation_map, cycle.request.pose, self.clock.now(), p.moving_objects)
        pose = self.transforms.transform_pose(request.pose, self.tracker.path.frame_id)
        return self._keeping.choose(
            replace(request, pose=pose),
            self.limits(cycle),
            p.standing,
            around,
            lambda: self.sampled(cycle, around),
            lambda: self._is_narrow(cycle),
            lambda command: keeps_centre_free(cycle, command),
        )

    def _is_narrow(self, cycle: ControlCycle) -> bool:
        """Whether the robot stops or reverses near ahead where it cannot turn; for a car, whether it does near by.

        A car that cuts the curve before a cusp, or before a narrow goal, cannot make up for it behind it.
        """
        footprint, tracker = cycle.footprint, cycle.tracker
        reach = AHEAD * footprint.footprint.circumscribed_radius + 0.5 * math.pi * self.turning_radius
        if self._keeping.car is not None and (np.abs(tracker.cusps[:-1] - tracker.progress) <= reach).any():
            return True
        if math.isclose(footprint.footprint.circumscribed_radius, footprint.footprint.inscribed_radius, rel_tol=0.1):
            return False  # a round one turns where it fits
        return cannot_turn_ahead(tracker, reach, lambda poses: footprint.first_collision(cycle.costmap, poses) < 0)


def keeps_centre_free(cycle: ControlCycle, command: Twist) -> bool:
    """Whether the robot's centre stays below the inscribed cost for as long as a command is looked ahead."""
    pose = cycle.request.pose
    driven = arc_poses((pose.x, pose.y, pose.yaw), command.vx, 0.0, command.wz, LOOK, LOOK_STEP)
    costs = [cycle.costmap.cost_at(x, y) for x, y, _ in driven.tolist()]
    return all(cost is None or cost < INSCRIBED or cost == UNKNOWN for cost in costs)
