"""Turn on the spot, so that sensors see all around, but only where the ground is level enough to turn safely.

Helps against obstacles that are stale in the map and against a bad heading. On a slope steeper than ``max_slope``
turning could tip or slide the robot: the behaviour ends with IMPASSABLE instead.
"""

from __future__ import annotations

import math

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.motion.goal_approach import heading_error
from mbf_mesh_nav.motion.guarded_motion import GuardedRecovery


class RotateParameters(GuardedMotionParameters):
    """Parameters of ``mesh.rotate``."""

    angle: float = parameter(2.0 * math.pi, "How far to turn; negative = clockwise.", unit="rad")
    yaw_rate: float = parameter(0.6, "Turning speed.", unit="rad/s", gt=0.0, le=3.0)
    max_slope: float = parameter(0.35, "Steeper ground is not turned on.", unit="rad", gt=0.0, le=1.5)
    time_limit: float = parameter(30.0, "Give up after this time.", unit="s", gt=0.0, le=600.0)


class RotateRecovery(GuardedRecovery):
    """Turns by an angle, measured on the poses."""

    Parameters = RotateParameters
    parameters: RotateParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Turn until the angle is reached; checks the slope all the time."""
        p = self.parameters
        last = request.motion.pose()
        turned = 0.0

        def velocity(pose: Pose) -> Twist | RecoveryResult:
            nonlocal last, turned
            turned += heading_error(last, pose)
            last = pose
            if turned * math.copysign(1.0, p.angle) >= abs(p.angle):
                return RecoveryResult(RecoveryOutcome.SUCCESS, f"turned {turned:.2f} rad")
            spot = self.mesh_map.locate_one(pose.position, 1.0)
            if spot is None:
                return RecoveryResult(RecoveryOutcome.FAILURE, "the robot is more than 1 m from the surface")
            slope = math.acos(min(max(float(self.mesh_map.face_normals[spot.face, 2]), -1.0), 1.0))
            if slope > p.max_slope:
                message = f"the ground slopes {slope:.2f} rad, turning is allowed up to {p.max_slope:g} rad"
                return RecoveryResult(RecoveryOutcome.IMPASSABLE, message)
            return Twist.planar(wz=math.copysign(p.yaw_rate, p.angle))

        return self.drive(request, velocity)
