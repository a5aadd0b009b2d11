"""Drive straight back a little, out of a dead end or away from what is in front.

When to use: the robot stands too close to turn. When not: nothing looks backward - a rolling costmap remembers what
the robot saw on its way in, but not what has come up behind it.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_costmap_nav.control.guarded_motion import GuardedMotionParameters, GuardedRecovery


class BackUpParameters(GuardedMotionParameters):
    """Parameters of ``costmap.back_up``."""

    distance: float = parameter(0.3, "How far to drive back.", unit="m", gt=0.0, le=10.0)
    speed: float = parameter(0.1, "How fast.", unit="m/s", gt=0.0, le=2.0)


class BackUpRecovery(GuardedRecovery):
    """Drives backward on a straight line."""

    Parameters: ClassVar[type[PluginParameters]] = BackUpParameters
    parameters: BackUpParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Drive back until the distance is covered."""
        start = request.motion.pose()
        command = Twist.planar(vx=-self.parameters.speed)

        def finished(pose: Pose) -> bool:
            return start.distance_to(pose) >= self.parameters.distance

        result = self.drive(request, lambda _: command, finished)
        covered = start.distance_to(request.motion.pose())
        return RecoveryResult(result.outcome, f"{result.message or 'done'}, {covered:.2f} m back")
