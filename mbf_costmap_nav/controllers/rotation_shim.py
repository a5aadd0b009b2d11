"""Rotation shim: turn in place towards a new path first, then let another controller drive.

When to use: controllers that start a path with a wide arc or back up (MPPI, DWA) on robots that can turn in place in
tight spaces. When not: ``costmap.regulated_pure_pursuit``, which turns by itself, and car-like robots. A robot that
rolls brakes first.

The inner controller is constructed here, on the same context, from its own parameter block: ``inner_type`` is a type as
in the list of controllers, ``inner: {...}`` its parameters; both are checked with the rest of the configuration. There
is no reference to another configured plugin.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.braking import LastFreeArc
from mbf_abstract.maps.controllers.inertia import InertiaParameters, braking_distance, stopping_speed
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult, InnerPlugin, PluginKind
from mbf_costmap_nav.control.path_handling import ControlCycle, PathFollower, to_base_frame
from mbf_costmap_nav.control.rolling import rolled_poses
from mbf_costmap_nav.planning.nav_core import wrap_nav_core
from mbf_costmap_nav.plugins import CostmapContext

STEP = 0.05
"""Time [s] from pose to pose where it looks ahead."""


class RotationShimParameters(PluginParameters):
    """Parameters of ``costmap.rotation_shim``."""

    inner_type: str = parameter(
        "mppi", "Type of the controller that drives, as in the list of controllers.", dynamic=False
    )
    inner: dict[str, Any] = parameter({}, "Parameters of that controller.", dynamic=False)
    angular_dist_threshold: float = parameter(
        0.785, "Turn first if the path is further off.", unit="rad", gt=0.0, le=3.2
    )
    angular_done_threshold: float = parameter(0.3, "Aligned well enough to drive.", unit="rad", gt=0.0, le=3.2)
    forward_sampling_distance: float = parameter(0.5, "Path point to turn to.", unit="m", gt=0.0, le=10.0)
    rotate_to_heading_vel: float = parameter(1.2, "Yaw rate of the turn.", unit="rad/s", gt=0.0, le=20.0)
    acc_lim_x: float | None = parameter(
        None,
        "Largest change of speed before the turn; absent = that of the inner controller, inf if it has none.",
        unit="m/s^2",
        gt=0.0,
        allow_inf=True,
    )
    acc_lim_theta: float = parameter(3.2, "Change of the yaw rate.", unit="rad/s^2", gt=0.0, le=100.0)
    control_period: float = parameter(0.05, "Time between two calls.", unit="s", gt=0.0, le=1.0)


class RotationShimController(PathFollower):
    """Aligns with the path, then delegates."""

    Parameters: ClassVar[type[PluginParameters]] = RotationShimParameters
    parameters: RotationShimParameters
    leaves_contacts = True
    inner_plugins = (InnerPlugin(PluginKind.CONTROLLER, "inner_type", "inner"),)

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        # The server's registry has already checked the type when it validated the configuration.
        registry = PluginRegistry("costmap", adapters=(wrap_nav_core,))
        inner_class: Any = registry.load(PluginKind.CONTROLLER, self.parameters.inner_type)
        parameters = inner_class.Parameters.model_validate(self.parameters.inner)
        self._inner: AbstractController = inner_class(
            replace(context, name=f"{self.name}.inner", parameters=parameters)
        )
        self._aligning, self._last = False, LastFreeArc()

    @property
    def turns_on_the_spot(self) -> bool:
        """Always true."""
        return True

    def set_plan(self, path: Path) -> bool:
        """Hand the path to both; alignment starts over."""
        self._aligning = True
        return super().set_plan(path) and self.hand_on(self._inner, path)

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Delegated to the inner controller."""
        super().is_goal_reached(pose, dist_tolerance, angle_tolerance)
        return self._inner.is_goal_reached(pose, dist_tolerance, angle_tolerance)

    def cancel(self) -> bool:
        """Delegated to the inner controller."""
        return self._inner.cancel()

    def compute_velocity_commands(self, request: ControlRequest) -> ControlResult:
        """Turn while the path is off the heading, else delegate."""
        cycle = self.begin_cycle(request)
        if isinstance(cycle, ControlResult):
            return cycle
        angle = self._angle_to_path(cycle)
        limit = (
            self.parameters.angular_done_threshold if self._turning(cycle) else self.parameters.angular_dist_threshold
        )
        self._aligning = self._aligning and abs(angle) > limit and not cycle.touches  # the inner one gets it out
        command = self._rotation(angle, request.velocity)
        # One of them for good: if the inner one turns back, the shim would turn again, and so on.
        self._aligning = self._aligning and not self._sweeps_obstacle(cycle, angle, command)
        if not self._aligning:
            result = self._inner.compute_velocity_commands(request)
        else:
            result = ControlResult(ExePathOutcome.SUCCESS, "turning to the path", command)
        self._last.keep(result.command, self.clock.now())
        return result

    def _turning(self, cycle: ControlCycle) -> bool:
        return abs(cycle.request.velocity.wz) > 1e-2 and abs(cycle.request.velocity.vx) < 1e-2

    def _angle_to_path(self, cycle: ControlCycle) -> float:
        """Bearing [rad] of the path point ahead in the base frame; not of one behind a change of gears."""
        tracker, distance = cycle.tracker, self.parameters.forward_sampling_distance
        ahead = tracker.ahead(distance)[-1] if tracker.on_last_section else tracker.carried_on(distance)
        x, y = to_base_frame(ahead[None], cycle.request.pose)[0].tolist()
        if cycle.tracker.driving_backward:
            x, y = -x, -y
        return math.atan2(y, x) if math.hypot(x, y) > 1e-3 else 0.0

    @property
    def _inertia(self) -> InertiaParameters:
        """What is stated here, else what the inner controller goes by."""
        p, known = self.parameters, getattr(self._inner.parameters, "acc_lim_x", None)
        braking = next((one for one in (p.acc_lim_x, known) if one is not None), math.inf)
        return InertiaParameters(acc_lim_x=braking, acc_lim_theta=p.acc_lim_theta, control_period=p.control_period)

    def _rotation(self, angle: float, measured: Twist) -> Twist:
        """The turn by ``angle`` [rad], as far as the robot can take it up; one that rolls brakes straight on first."""
        p = self.parameters
        stopping = stopping_speed(abs(angle), p.acc_lim_theta, p.control_period)
        wanted = Twist.planar(wz=math.copysign(min(p.rotate_to_heading_vel, stopping), angle))
        return self._inertia.reachable(wanted, measured, begin=self._last.begins_at(wanted, measured, self.clock.now()))

    def _sweeps_obstacle(self, cycle: ControlCycle, angle: float, command: Twist) -> bool:
        """Whether turning for another half second, or until it has braked, would touch a lethal cell.

        A robot that rolls is looked at until it stands, and turns there. Where it touches something, the inner
        controller takes over.
        """
        p, pose, measured = self.parameters, cycle.request.pose, cycle.request.velocity
        turn, rolled, limits = command.wz, np.array([(pose.x, pose.y, pose.yaw)]), self._inertia
        if braking_distance(measured.vx, limits.acc_lim_x) > 0.0:
            turn, now = math.copysign(p.rotate_to_heading_vel, angle), Twist.planar(wz=measured.wz)
            times = {"duration": abs(measured.vx) / limits.acc_lim_x, "turning": 0.5 * abs(now.wz) / p.acc_lim_theta}
            rolled, _ = rolled_poses(pose, measured.vx, now, limits.acc_lim_x, math.inf, step=STEP, **times)
        duration = max(0.5, p.control_period + 0.5 * abs(turn) / p.acc_lim_theta)
        turned = arc_poses(tuple(rolled[-1].tolist()), 0.0, 0.0, turn, duration, STEP)
        return cycle.first_collision(np.concatenate([rolled, turned])) >= 0
