"""Moving the robot inside a recovery: slowly, with the footprint checked ahead, cancelable, stopped at the end.

``GuardedRecovery`` is the base of the recoveries that move. Its ``drive`` repeats one velocity until a condition holds
and ends with IMPASSABLE before the footprint would meet an obstacle or the end of the map. A robot that already touches
one may move as long as it touches no more than before, so backing out of a collision works and driving deeper into it
does not. Where the whole footprint lies on obstacles no direction is known to lead out, and only ``escape`` moves.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint_check import FootprintCheck, arc_poses
from mbf_costmap_nav.plugins import CostmapRecovery


class GuardedMotionParameters(PluginParameters):
    """Parameters every moving recovery has."""

    control_period: float = parameter(0.05, "Time between two commands.", unit="s", gt=0.0, le=1.0)
    check_ahead_time: float = parameter(0.6, "How far ahead the footprint is checked.", unit="s", gt=0.0, le=10.0)
    time_limit: float = parameter(15.0, "Give up after this time.", unit="s", gt=0.0, le=600.0)


class GuardedRecovery(CostmapRecovery):
    """Base of the recoveries that move the robot: write ``recover`` and use ``drive``."""

    parameters: GuardedMotionParameters

    leaves_collisions: ClassVar[bool] = False
    """Whether the recovery itself chooses motions that lead out of a collision, however deep it is."""

    @abstractmethod
    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Do the behaviour's work; the robot is stopped afterwards in any case."""

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Run ``recover``, report a lost pose as TF_ERROR, and send zero velocity on every way out."""
        try:
            return self.recover(request)
        except (RobotStateError, TransformError) as error:
            return RecoveryResult(RecoveryOutcome.TF_ERROR, str(error))
        finally:
            request.motion.send(Twist())

    def drive(
        self,
        request: RecoveryRequest,
        velocity: Callable[[Pose], Twist],
        finished: Callable[[Pose], bool],
    ) -> RecoveryResult:
        """Command ``velocity(pose)`` each period until ``finished(pose)``; stand while the map is not current.

        Returns
        -------
        RecoveryResult
            SUCCESS, CANCELED, IMPASSABLE (with the place of the obstacle), or FAILURE when the time is over.
        """
        end = self.clock.now() + self.parameters.time_limit
        while not request.cancel_token.cancelled:
            pose = request.motion.pose()
            if finished(pose):
                return RecoveryResult(RecoveryOutcome.SUCCESS)
            blind = self.costmap.currency_problem(self.clock.now())
            if self.clock.now() >= end:
                text = f"not done after {self.parameters.time_limit:g} s{f': {blind}' if blind else ''}"
                return RecoveryResult(RecoveryOutcome.FAILURE, text)
            command = Twist() if blind else velocity(pose)
            if obstacle := self.obstacle_ahead(pose, command):
                return RecoveryResult(RecoveryOutcome.IMPASSABLE, obstacle)
            if not request.motion.send(command):
                return RecoveryResult(RecoveryOutcome.CANCELED, "the velocity gate refused the command")
            if not request.motion.sleep(self.parameters.control_period):
                break
        return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)

    def obstacle_ahead(self, pose: Pose, command: Twist) -> str:
        """Say where moving on would touch more of obstacles and the end of the map than now; empty: the way is free."""
        costmap, pose = self.costmap.snapshot(), self.on_map(pose)
        check = FootprintCheck(self.costmap.footprint, costmap.resolution)

        def touched(x: float, y: float, yaw: float) -> int:
            return check.lethal_count(costmap, x, y, yaw) + check.outside_count(costmap, x, y, yaw)

        allowed = touched(pose.x, pose.y, pose.yaw)
        if not self.leaves_collisions:
            allowed = min(allowed, len(check.samples) - 1)
        for x, y, yaw in self._poses_ahead(pose, command, costmap):
            if touched(x, y, yaw) > allowed:
                return f"an obstacle is in the way: the footprint would touch it at ({x:.2f}, {y:.2f}, {yaw:.2f} rad)"
        return ""

    def _poses_ahead(self, pose: Pose, command: Twist, costmap: Costmap) -> list[list[float]]:
        duration = self.parameters.check_ahead_time
        rim_speed = command.speed + abs(command.wz) * self.costmap.circumscribed_radius
        step = float(np.clip(0.5 * costmap.resolution / max(rim_speed, 1e-6), duration / 100.0, duration))
        poses = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, duration, step)
        return [list(row) for row in poses.tolist()]
