"""Where a controller that samples motions keeps to its path instead: in narrow places, and where it got nowhere.

When to use: in every controller that chooses the best of sampled motions, on all maps. Near a wall the cheapest motion
is often to stand: the price of the costs there outweighs what is left of the path. And samples cut the strokes of a
manoeuvre, which fits only as it was planned. When not: cars without a controller of their own for that (``car``), as
``follow_path`` cannot drive them; they only give up.

Rule: a path is driven as ``follow_path`` drives it, with the limits of the controller, before a place where the robot
has to stop or reverse but cannot turn, or has hardly any room to either side (``tight_places``); and where the samples
have stood for a while, or failed, until the robot is ``AWAY`` from there. Where that is blocked or would meet somebody
who moves, the samples decide. A robot that still stands after longer gets no command any more, but the failure
NO_VALID_CMD with its place.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.braking import BrakesOnItsArc, LastFreeArc
from mbf_abstract.maps.controllers.failures import stands
from mbf_abstract.maps.controllers.follow_path import FollowPath
from mbf_abstract.maps.controllers.follow_path_parameters import FollowPathParameters
from mbf_abstract.maps.controllers.inertia import InertiaParameters
from mbf_abstract.maps.controllers.motion_limits import MotionLimits
from mbf_abstract.maps.controllers.room_to_turn import CREEPING
from mbf_abstract.maps.controllers.standing import Standing, StandingParameters
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.tracking.avoidance import MovingAround
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult

AWAY, AHEAD, FAR = 0.5, 0.25, 2.0
"""The robot samples again ``AWAY`` [m] from where it stood if it has come ``AHEAD`` on its path, else ``FAR``."""
AT_END = 0.05
"""A car so near [m] to the end of its path keeps to nothing: one with another heading needs a new plan."""
FARTHEST = 100.0
"""However far [m] from its path the robot is, that is for the controller to judge."""
LOOK, LOOK_STEP = 1.5, 0.1
"""Time [s] over which motions along the path are compared with what moves, and between two looks."""


class KeepingToPath:
    """The choice between sampled motions and the path, from cycle to cycle.

    Parameters
    ----------
    context : MapContext
        Of the controller.
    """

    def __init__(self, context: MapContext[Any]) -> None:
        self._follower = FollowPath(replace(context, name=f"{context.name}.path", parameters=FollowPathParameters()))
        self._standing = Standing()
        self._brakes_by = InertiaParameters()
        self._stood_at: Pose | None = None
        self._remained = self._horizon = math.inf
        self.is_keeping = False
        """Whether the last command was one along the path."""
        self.car: BrakesOnItsArc | None = None
        """What keeps a car to its path; None = nothing does."""

    @property
    def last_arc(self) -> LastFreeArc:
        """The arc of the last command, whatever chose it."""
        return self._follower.last_arc

    @property
    def is_leaving(self) -> bool:
        """Whether the robot is leaving a contact."""
        return self._follower.is_leaving

    def drive_with(
        self,
        max_vel_x: float,
        max_vel_theta: float,
        inertia: InertiaParameters,
        brakes_by: InertiaParameters,
        *,
        allow_reversing: bool,
        horizon: float = math.inf,
    ) -> None:
        """Take over the limits [m/s, rad/s] of the controller, and the robot's inertia.

        ``brakes_by`` is how it brakes along its arc where no motion is free any more. Of a turn to the path that takes
        longer than ``horizon`` [s] the samples see no good; it is driven as ``follow_path`` drives it.
        """
        self._horizon = horizon
        self._follower.parameters = FollowPathParameters(
            max_vel_x=max_vel_x,
            max_vel_theta=max_vel_theta,
            allow_reversing=allow_reversing,
            max_path_distance=FARTHEST,
            **{name: getattr(inertia, name) for name in InertiaParameters.model_fields},
        )
        self._brakes_by = brakes_by

    def set_plan(self, path: Path) -> None:
        """Take over a path. Where the robot stood is remembered, however often it is planned anew."""
        self._follower.set_plan(path)
        if self.car is not None:
            self.car.set_plan(path)

    def update(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Take over the progress, and the tolerances [m, rad] of the goal.

        Whether the robot has reached the goal as near as the path leads to it.
        """
        reached = self._follower.is_goal_reached(pose, dist_tolerance, angle_tolerance)
        if self.car is not None:
            self.car.is_goal_reached(pose, dist_tolerance, angle_tolerance)
        return reached and self._follower.ended_early

    def closely(self, request: ControlRequest, limits: MotionLimits, *, is_stuck: bool = False) -> ControlResult | None:
        """The answer that keeps to the path before a tight place; None where there is none, or it is blocked.

        A controller ``is_stuck`` whose own motion is not free; then it keeps to the path until it has come away.
        """
        is_tight = self._follower.to_tight_place(request.pose, request.velocity.vx) < math.inf
        if not (self._has_stood(request.pose, is_stuck) or is_tight):
            return None
        answer = self._follower.free_motion(request)
        if not answer.success or not isinstance(answer.command, Twist):
            return None
        return replace(answer, command=self._held(answer.command, request.velocity, limits))

    def out_of_contact(self, request: ControlRequest, limits: MotionLimits) -> ControlResult | None:
        """The answer that leads straight out of what the robot touches; None for a car, and where there is none."""
        out = self._follower.drive_out(request.pose) if limits.leaves_contacts and not limits.is_car else None
        if out is None:
            return None
        self.is_keeping = True
        limits = replace(limits, slowest=min(limits.slowest, -CREEPING))
        return ControlResult(ExePathOutcome.SUCCESS, "", self._held(out, request.velocity, limits))

    def choose(
        self,
        request: ControlRequest,
        limits: MotionLimits,
        p: StandingParameters,
        around: MovingAround,
        sampled: Callable[[], ControlResult],
        is_narrow: Callable[[], bool] = lambda: False,
        accepts: Callable[[Twist], bool] = lambda command: True,
    ) -> ControlResult:
        """The answer of this cycle.

        Parameters
        ----------
        request : ControlRequest
            In the frame of the path.
        around : MovingAround
            What moves around the robot.
        sampled : callable
            The answer of the controller's samples.
        is_narrow : callable
            Whether the path ahead can only be driven as it is.
        accepts : callable
            Whether a command along the path keeps to what the samples may enter; ``follow_path`` asks for its outline.
        """
        now = self._follower.clock.now()
        stood = self._standing.time(now, limits.fastest, limits.turning)
        if (out := self.out_of_contact(request, limits)) is not None:
            self._standing.commanded(out.command)
            return self._or_brake(out, request.velocity, limits)
        along, reason = None, ""
        drives = not limits.is_car or (self.car is not None and self._follower.remaining > AT_END)
        keeps = drives and (
            self._has_stood(request.pose, stood >= p.keep_to_path_after)
            or self._follower.turns_to_path_after(request.pose) > self._horizon
            or is_narrow()
            or self._follower.to_tight_place(request.pose, request.velocity.vx) < math.inf
        )
        if keeps:
            along, reason = self._along_path(request, limits, around, accepts)
        result = along or sampled()
        if drives and not (result.success or keeps):
            along, _ = self._along_path(request, limits, around, accepts)
            if along:
                self._stands_at(request.pose)
                result = along
        self.is_keeping = along is not None
        if stood >= p.give_up_after and result.success and not result.hindered_by:
            result = stands(request.pose, stood, reason)
        if result.hindered_by or not result.success:
            self._standing.restart(now)
        self._standing.commanded(result.command)
        return self._or_brake(result, request.velocity, limits)

    def _or_brake(self, result: ControlResult, measured: Twist, limits: MotionLimits) -> ControlResult:
        """An answer as far as the robot can do it until the next, or braking along its arc instead of a refusal."""
        if not result.success:
            return self.last_arc.answer(result, measured, self._brakes_by)
        if isinstance(result.command, Twist):
            begin = self._goes_on_from(result.command, measured, limits)
            result = replace(result, command=limits.reached(result.command, begin))
        self.last_arc.keep(result.command, self._follower.clock.now())
        return result

    def _held(self, command: Twist, measured: Twist, limits: MotionLimits) -> Twist:
        """The same arc within the limits; its turn counts from what is measured, not to turn past the path."""
        begin = self._goes_on_from(command, measured, limits)
        return limits.hold(command, Twist.planar(begin.vx, begin.vy, measured.wz))

    def _goes_on_from(self, command: Twist, measured: Twist, limits: MotionLimits) -> Twist:
        """What a command is counted from; of a car where its samples begin, whose curve is as tight as can be."""
        return measured if limits.is_car else self.last_arc.begins_at(command, measured, self._follower.clock.now())

    def _has_stood(self, pose: Pose, stands_now: bool) -> bool:
        """Whether the robot stands, or has not come away yet from where it did.

        One that has backed out, and then sampled, would stand at the same place again.
        """
        if stands_now:
            if self._stood_at is None:
                self._standing.may_turn_again()
            self._stands_at(pose)
        elif self._stood_at is not None:
            is_ahead = self._follower.remaining <= self._remained - AHEAD
            if pose.distance_to(self._stood_at) > (AWAY if is_ahead else FAR):
                self._stood_at = None
        return self._stood_at is not None

    def _stands_at(self, pose: Pose) -> None:
        self._stood_at, self._remained = pose, self._follower.remaining

    def _along_path(
        self, request: ControlRequest, limits: MotionLimits, around: MovingAround, accepts: Callable[[Twist], bool]
    ) -> tuple[ControlResult | None, str]:
        """The answer that keeps to the path; None, and why, where it is blocked or somebody comes."""
        follower = self.car if limits.is_car and self.car is not None else self._follower
        answer = follower.free_motion(request)
        if not isinstance(answer.command, Twist) or not answer.success:
            return None, answer.message
        command = self._held(answer.command, request.velocity, limits)
        if not accepts(command):
            return None, "it costs too much"
        if around.anybody:
            driven = arc_poses((0.0, 0.0, around.yaw), command.vx, 0.0, command.wz, LOOK, LOOK_STEP)
            if around.meet(np.ascontiguousarray(driven.T[:, :, None], dtype=np.float32), LOOK_STEP).touches[0]:
                return None, "somebody comes"
        return replace(answer, command=command), ""
