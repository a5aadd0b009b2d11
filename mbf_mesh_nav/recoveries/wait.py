"""Stand still for a while: people and vehicles move on, sensors catch up. The first thing to try in a crowd."""

from __future__ import annotations

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.motion.guarded_motion import reports_lost_pose, run_guarded
from mbf_mesh_nav.plugins import MeshRecovery


class WaitParameters(PluginParameters):
    """Parameters of ``mesh.wait``."""

    duration: float = parameter(3.0, "How long to wait.", unit="s", ge=0.0)


class WaitRecovery(MeshRecovery):
    """Commands zero velocity for a time."""

    Parameters = WaitParameters
    parameters: WaitParameters

    @reports_lost_pose
    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Wait; ends early when cancelled."""
        end = self.clock.now() + self.parameters.duration

        def step(pose: Pose) -> Twist | RecoveryResult:
            if self.clock.now() >= end:
                return RecoveryResult(RecoveryOutcome.SUCCESS, f"waited {self.parameters.duration:g} s")
            return Twist()

        return run_guarded(request, self.clock, self.parameters.duration + 5.0, step)
