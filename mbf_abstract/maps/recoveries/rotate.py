"""Turn in place, so that the sensors see all around.

When to use: after clearing, for a robot with a narrow field of view that can turn in place. When not: car-like robots,
long ones in narrow places (it ends with IMPASSABLE before the footprint would sweep an obstacle), and slopes on which
turning could tip or slide the robot (IMPASSABLE above ``max_turning_slope`` of the mesh map).

The angle is summed up from the measured poses, so turns beyond one revolution work.
"""

from __future__ import annotations

import math
from typing import ClassVar

from mbf_abstract.geometry import Pose, Twist, normalize_angle
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult


class RotateParameters(GuardedMotionParameters):
    """Parameters of ``rotate``."""

    angle: float = parameter(2.0 * math.pi, "Angle to turn, left positive.", unit="rad", ge=-31.5, le=31.5)
    yaw_rate: float = parameter(0.8, "How fast it turns, at most.", unit="rad/s", gt=0.0, le=10.0)
    min_yaw_rate: float = parameter(0.2, "Least yaw rate while braking.", unit="rad/s", gt=0.0, le=10.0)
    acc_lim_theta: float = parameter(1.6, "Braking of the turn.", unit="rad/s^2", gt=0.0, le=100.0)
    tolerance: float = parameter(0.05, "Allowed rest of the angle.", unit="rad", gt=0.0, le=1.0)
    time_limit: float = parameter(30.0, "Give up after this time.", unit="s", gt=0.0, le=600.0)


class RotateRecovery(GuardedRecovery):
    """Turns in place by an angle."""

    Parameters: ClassVar[type[PluginParameters]] = RotateParameters
    parameters: RotateParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Turn until the angle is summed up."""
        p = self.parameters
        last_yaw = request.motion.pose().yaw
        turned = 0.0

        def finished(pose: Pose) -> bool:
            nonlocal last_yaw, turned
            turned += normalize_angle(pose.yaw - last_yaw)
            last_yaw = pose.yaw
            return abs(p.angle - turned) <= p.tolerance or abs(turned) >= abs(p.angle)

        def velocity(_: Pose) -> Twist:
            braking = math.sqrt(2.0 * p.acc_lim_theta * abs(p.angle - turned))
            return Twist.planar(wz=math.copysign(max(min(p.yaw_rate, braking), p.min_yaw_rate), p.angle))

        result = self.drive(request, velocity, finished)
        return RecoveryResult(result.outcome, f"{result.message or 'done'}, turned {turned:.2f} of {p.angle:.2f} rad")
