"""Moving the robot inside a recovery, the same on every map: slowly, cancelable, stopped at the end.

``GuardedRecovery`` is the base of the recoveries that move. The map gives three answers: why its data are too
old to drive on, what the robot would touch along a motion, and how much of its speed is safe among those who move. The
loop drives so fast and does the rest:

=================================  =====================================================================
what happens                       how the behaviour ends
=================================  =====================================================================
finished                           SUCCESS
no velocity but a result           with that
canceled                           CANCELED, the reason
time over                          PAT_EXCEEDED
something ahead would be touched   IMPASSABLE, the place
somebody would be at any speed     it waits within its time; IMPASSABLE, whom for, after the map's ``max_wait``
the gate refuses a command         STOPPED
no fresh pose or velocity          TF_ERROR
the map is stale                   it waits, and goes on when the map is fresh again within its time
=================================  =====================================================================

Whatever happens, the last command is zero.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable
from typing import ClassVar

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Pose, Twist, normalize_angle
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.map_plugin import MapPlugin
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.tracking.motion_guard import MotionGuard
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import AbstractRecovery, RecoveryRequest, RecoveryResult
from mbf_abstract.time.cancel import CancelToken

GATE_REFUSED = "the velocity gate refused the command"


class GuardedMotionParameters(PluginParameters):
    """Parameters every moving recovery has."""

    control_period: float = parameter(0.05, "Time between two commands.", unit="s", gt=0.0, le=1.0)
    check_ahead_time: float = parameter(0.6, "How far ahead each motion must be free.", unit="s", gt=0.0, le=10.0)
    time_limit: float = parameter(15.0, "Give up after this time.", unit="s", gt=0.0, le=600.0)


class GuardedRecovery(MapPlugin, AbstractRecovery):
    """Base of the recoveries that move the robot: write ``recover`` and use ``drive``."""

    parameters: GuardedMotionParameters
    may_go_deeper: ClassVar[bool] = False
    """Whether it may lie deeper in what it touches than it did."""

    @abstractmethod
    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Run the behaviour; the robot is stopped afterwards in any case."""

    def obstacle_ahead(self, pose: Pose, command: Twist) -> str:
        """What that stands the robot would touch if it moved on with ``command``, and where; empty if it is free."""
        return self.navigation_map.obstacle_ahead(self.on_map(pose), command, self.parameters.check_ahead_time)

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Run ``recover``, report a lost pose or velocity as TF_ERROR, and send zero velocity at the end."""
        try:
            return self.recover(request)
        except (RobotStateError, TransformError) as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        finally:
            request.motion.send(Twist())

    def _maps(self) -> Iterable[NavigationMap]:
        """All maps of the server: speed limits may stand on any."""
        return self.maps.values() or [self.navigation_map]

    def _guard(self, obstacle_ahead: Callable[[Pose, Twist], str]) -> MotionGuard:
        within = 0.0 if self.may_go_deeper else self.parameters.check_ahead_time
        return MotionGuard(self.navigation_map, self._maps(), self.transforms, obstacle_ahead, within)

    def drive(
        self,
        request: RecoveryRequest,
        velocity: Callable[[Pose], Twist | RecoveryResult],
        finished: Callable[[Pose], bool] = lambda _: False,
        obstacle_ahead: Callable[[Pose, Twist], str] | None = None,
    ) -> RecoveryResult:
        """Send ``velocity(pose)`` each period until ``finished(pose)``, a result instead of a velocity, or another end.

        What a motion would touch is answered by ``obstacle_ahead``, by default that of the recovery.

        While the map is stale the robot stands and ``velocity`` is not called. One refused command does not end the
        motion, as the goal may be paused and the sleep lasts until it is resumed; two refusals in a row do.
        """
        guard = self._guard(obstacle_ahead or self.obstacle_ahead)
        motion, token, limit = request.motion, request.cancel_token, self.parameters.time_limit
        deadline, refusals, last, waits_for = self.clock.now() + limit, 0, Twist(), ""
        while not token.cancelled:
            pose = motion.pose()
            if finished(pose):
                return RecoveryResult(RecoveryOutcome.SUCCESS)
            stale = self.navigation_map.stale_reason(self.clock.now())
            if self.clock.now() >= deadline:
                why = stale or waits_for
                text = f"not done after {limit:g} s{f': {why}' if why else ''}"
                return RecoveryResult(RecoveryOutcome.PAT_EXCEEDED, text)
            answer = Twist() if stale else velocity(pose)
            if isinstance(answer, RecoveryResult):
                return answer
            measured = motion.velocity()
            moving = last if measured == Twist() else measured  # a robot without odometry measures none
            judged = guard.judge(pose, self.on_map(pose), moving, answer, self.clock.now())
            if judged.obstacle:
                return RecoveryResult(RecoveryOutcome.IMPASSABLE, judged.obstacle)
            waits_for = judged.waits_for
            refusals, last = 0 if motion.send(judged.command) else refusals + 1, Twist() if waits_for else judged.asked
            if refusals > 1 and not token.cancelled:
                return RecoveryResult(RecoveryOutcome.STOPPED, GATE_REFUSED)
            if not motion.sleep(self.parameters.control_period):
                break
        return ended_by_others(token)

    def turn_to_heading(self, request: RecoveryRequest, yaw: float, limit: float, tolerance: float) -> RecoveryResult:
        """Turn on the spot to a heading [rad], no faster than ``limit`` [rad/s], until ``tolerance`` [rad] is left."""

        def left(pose: Pose) -> float:
            return normalize_angle(yaw - pose.yaw)

        def velocity(pose: Pose) -> Twist:
            return Twist.planar(wz=max(-limit, min(limit, 2.0 * left(pose))))

        return self.drive(request, velocity, lambda pose: abs(left(pose)) <= tolerance)


def ended_by_others(token: CancelToken) -> RecoveryResult:
    """Result of a behaviour that was asked to end: by a cancel, or because its time or its plugin is over."""
    if token.cancelled:
        return RecoveryResult(RecoveryOutcome.CANCELED, token.reason)
    return RecoveryResult(RecoveryOutcome.STOPPED, "the behaviour was asked to end")
