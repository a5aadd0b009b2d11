"""Recovery `look_around_on_mesh`: forget what sensors have marked and turn once around, so that they look again.

When to use: the map shows obstacles that have gone. When not: the robot is not round and stands beside a wall.
"""

from __future__ import annotations

import math

from mbf_abstract.geometry import Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.plugins import MeshRecovery


class LookAroundOnMeshParameters(PluginParameters):
    """Parameters of `look_around_on_mesh`."""

    angle: float = parameter(2.0 * math.pi, "How far to turn.", unit="rad", gt=0.0, le=20.0)
    rate: float = parameter(0.5, "How fast to turn.", unit="rad/s", gt=0.0, le=5.0)


class LookAroundOnMesh(MeshRecovery):
    """Clears the map and turns."""

    Parameters = LookAroundOnMeshParameters
    parameters: LookAroundOnMeshParameters

    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Turn by time; the robot stands at the end, whatever ended the turn."""
        self.mesh_map.clear()
        end = self.clock.now() + self.parameters.angle / self.parameters.rate
        while not request.cancel_token.cancelled and self.clock.now() < end:
            if not request.motion.send(Twist.planar(wz=self.parameters.rate)):
                return RecoveryResult(RecoveryOutcome.FAILURE, "the velocity gate refused the command")
            if not request.motion.sleep(0.05):
                break
        request.motion.send(Twist())
        if self.clock.now() < end:
            return RecoveryResult(RecoveryOutcome.CANCELED, f"canceled {end - self.clock.now():.1f} s before the end")
        return RecoveryResult(RecoveryOutcome.SUCCESS, f"map cleared, turned by {self.parameters.angle:.2f} rad")
