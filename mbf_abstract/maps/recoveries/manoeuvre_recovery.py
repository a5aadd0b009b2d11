"""A recovery that drives a manoeuvre of ``maps.manoeuvres``: sections of one gear each, and turns on the spot."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery, ended_by_others
from mbf_abstract.maps.manoeuvres import Step
from mbf_abstract.maps.queries import PlanarPose
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult

LOOKAHEAD = 0.25  # m to the point of the manoeuvre that is steered to
END_REACHED, HEADING_REACHED = 0.04, 0.05  # m, rad
ATTEMPTS = 3
"""How often a manoeuvre out is searched: one may end a little short of its place, or be refused on the way."""


class ManoeuvreParameters(GuardedMotionParameters):
    """Parameters of a recovery that drives a manoeuvre."""

    speed: float = parameter(0.3, "How fast, forward and backward.", unit="m/s", gt=0.0, le=2.0)
    yaw_rate: float = parameter(0.8, "Yaw rate limit.", unit="rad/s", gt=0.0, le=3.0)


class ManoeuvreRecovery(GuardedRecovery):
    """Base of the recoveries that drive a manoeuvre."""

    parameters: ManoeuvreParameters

    @property
    def manoeuvre_speed(self) -> float:
        """How fast [m/s] a manoeuvre is driven, forward and backward."""
        return self.parameters.speed

    def drive_out(
        self, request: RecoveryRequest, search: Callable[[Pose], list[Step] | RecoveryResult]
    ) -> RecoveryResult:
        """Drive one manoeuvre after the other, ``ATTEMPTS`` at most, until there is a result instead of a next one.

        Parameters
        ----------
        search : callable
            Answers, for the robot's pose, the steps from there to where it may stand; or a result where it may stand
            already, and where no steps lead out.
        """
        result = RecoveryResult(RecoveryOutcome.SUCCESS)
        for _ in range(ATTEMPTS):
            begin = request.motion.pose()
            steps = search(begin)
            if isinstance(steps, RecoveryResult):
                given_up = request.cancel_token.cancelled and not steps.success
                return ended_by_others(request.cancel_token) if given_up else steps
            result = self.drive_along(begin, steps, request)
            if result.outcome not in (RecoveryOutcome.SUCCESS, RecoveryOutcome.IMPASSABLE):
                break
        return result

    def drive_along(
        self,
        begin: Pose,
        steps: list[Step],
        request: RecoveryRequest,
        at: PlanarPose = (0.0, 0.0, 0.0),
        is_enough: Callable[[Pose], bool] = lambda _: False,
    ) -> RecoveryResult:
        """Drive steps section by section, to the end or to what a command is refused for.

        Parameters
        ----------
        begin : Pose
            The steps are given in the plane of a robot that stands here.
        at : PlanarPose
            Where they begin.
        is_enough : callable
            Asked after each section whether the rest is of no use.
        """
        frame = Transform(begin.position, begin.orientation, begin.frame_id, "begin")
        for gear, section in groupby(steps, key=lambda step: step.gear):
            planned = [at, *(pose for step in section for pose in step.poses)]
            poses = [frame.apply_to_pose(Pose.planar(x, y, yaw, frame_id="begin")) for x, y, yaw in planned]
            result = self._turn(request, poses[-1].yaw) if gear == 0 else self._follow(request, poses, gear)
            if not result.success or is_enough(request.motion.pose()):
                return result
            at = planned[-1]
        return RecoveryResult(RecoveryOutcome.SUCCESS)

    def _turn(self, request: RecoveryRequest, yaw: float) -> RecoveryResult:
        return self.turn_to_heading(request, yaw, self.parameters.yaw_rate, HEADING_REACHED)

    def _follow(self, request: RecoveryRequest, poses: list[Pose], gear: int) -> RecoveryResult:
        """Drive along poses in one gear, by pure pursuit; the last one is prolonged for the point steered to."""
        last = np.asarray(poses[-1].position) + poses[-1].rotation[:, 0] * (gear * LOOKAHEAD)
        points = np.array([*(pose.position for pose in poses), last])
        tracker = PathTracker(Path.from_points(points, frame_id=poses[0].frame_id))
        speed, limit = gear * self.manoeuvre_speed, self.parameters.yaw_rate

        def finished(pose: Pose) -> bool:
            tracker.update(pose.position)
            return tracker.remaining <= LOOKAHEAD + END_REACHED

        def velocity(pose: Pose) -> Twist:
            _, curvature = arc_to(pose, tracker.point_at(tracker.progress + LOOKAHEAD))
            return Twist.planar(vx=speed, wz=max(-limit, min(limit, speed * curvature)))

        return self.drive(request, velocity, finished, self.obstacle_on_manoeuvre)

    def obstacle_on_manoeuvre(self, pose: Pose, command: Twist) -> str:
        """As for a path: a manoeuvre is searched where the robot touches nothing, and asked for no more."""
        return self.navigation_map.obstacle_on_path(self.on_map(pose), command, self.parameters.check_ahead_time)
