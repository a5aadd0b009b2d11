"""Drive straight, forward or back, to leave a place where planning fails.

When to use: the ground ahead is known to be free (out of an elevator, across a sill). When not: anything that needs
steering; it keeps the present heading and ends with IMPASSABLE before an obstacle.
"""

from __future__ import annotations

import math
from typing import ClassVar

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult


class DriveOnHeadingParameters(GuardedMotionParameters):
    """Parameters of ``drive_on_heading``."""

    distance: float = parameter(0.5, "How far to drive; negative = backward.", unit="m", ge=-20.0, le=20.0)
    speed: float = parameter(0.15, "How fast.", unit="m/s", gt=0.0, le=2.0)


class DriveOnHeadingRecovery(GuardedRecovery):
    """Drives a distance along the present heading."""

    Parameters: ClassVar[type[PluginParameters]] = DriveOnHeadingParameters
    parameters: DriveOnHeadingParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Drive until the distance is covered."""
        start, distance = request.motion.pose(), abs(self.parameters.distance)
        command = Twist.planar(vx=math.copysign(self.parameters.speed, self.parameters.distance))

        def finished(pose: Pose) -> bool:
            return start.distance_to(pose) >= distance

        result = self.drive(request, lambda _: command, finished)
        covered = start.distance_to(request.motion.pose())
        return RecoveryResult(result.outcome, f"{result.message or 'done'}, {covered:.2f} of {distance:.2f} m")
