"""Recovery `look_around`: forget what sensors have marked and turn once around, so that they look again.

When to use: the map shows obstacles that have gone. When not: the robot cannot turn on the spot.
"""

from __future__ import annotations

import math

from mbf_abstract.geometry import Pose, Twist, normalize_angle
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult


class LookAroundParameters(GuardedMotionParameters):
    """Parameters of `look_around`."""

    angle: float = parameter(2.0 * math.pi, "How far to turn.", unit="rad", gt=0.0, le=20.0)
    rate: float = parameter(0.5, "How fast to turn.", unit="rad/s", gt=0.0, le=5.0)


class LookAround(GuardedRecovery):
    """Clears the map and turns, on any map."""

    Parameters = LookAroundParameters
    parameters: LookAroundParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Turn by the angle; ``drive`` stands while the map is stale, and ends before an obstacle or on a cancel."""
        if not request.cancel_token.cancelled:
            self.navigation_map.clear()
        last, turned = request.motion.pose().yaw, 0.0

        def finished(pose: Pose) -> bool:
            nonlocal last, turned
            turned += normalize_angle(pose.yaw - last)
            last = pose.yaw
            return turned >= self.parameters.angle

        result = self.drive(request, lambda pose: Twist.planar(wz=self.parameters.rate), finished)
        return RecoveryResult(result.outcome, f"{result.message or 'map cleared'}, turned by {turned:.2f} rad")
