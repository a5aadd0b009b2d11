"""Drive straight back over ground that is free, the simplest way out of a dead end.

Looks at the surface behind the robot before every command and stops before borders, lethal and costly faces. Helps
when the robot stands too close to something in front; does not help when it is hemmed in (IMPASSABLE at once).
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.guarded_motion import blocked_vertices, free_distance, reports_lost_pose, run_guarded
from mbf_mesh_nav.plugins import MeshRecovery


class BackUpParameters(PluginParameters):
    """Parameters of ``mesh.back_up``."""

    distance: float = parameter(0.5, "How far to back up.", unit="m", gt=0.0, le=10.0)
    min_distance: float = parameter(0.1, "Less than this is a failure.", unit="m", ge=0.0)
    speed: float = parameter(0.2, "Backward speed.", unit="m/s", gt=0.0, le=2.0)
    clearance: float = parameter(0.3, "Free ground kept behind the robot's centre.", unit="m", ge=0.0)
    cost_limit: float = parameter(1.0, "Ground whose cost reaches this is not entered.", gt=0.0, allow_inf=True)
    time_limit: float = parameter(15.0, "Longest run.", unit="s", gt=0.0)


class BackUpRecovery(MeshRecovery):
    """Backs up along the robot's own heading."""

    Parameters = BackUpParameters
    parameters: BackUpParameters

    @reports_lost_pose
    def run_behavior(self, request: RecoveryRequest) -> RecoveryResult:
        """Back up until the distance is driven or the ground behind ends."""
        p = self.parameters
        begin = np.asarray(request.motion.pose().position)

        def step(pose: Pose) -> Twist | RecoveryResult:
            driven = float(np.linalg.norm(np.asarray(pose.position) - begin))
            if driven >= p.distance:
                return RecoveryResult(RecoveryOutcome.SUCCESS, f"backed up {driven:.2f} m")
            spot = self.mesh_map.locate_one(pose.position, 1.0)
            if spot is None:
                return RecoveryResult(RecoveryOutcome.FAILURE, "the robot is more than 1 m from the surface")
            blocked = blocked_vertices(self.mesh_map, p.cost_limit)
            behind = free_distance(self.mesh_map, blocked, spot, -pose.rotation[:, 0], p.clearance + 0.1)
            if behind > p.clearance:
                return Twist.planar(vx=-p.speed)
            outcome = RecoveryOutcome.SUCCESS if driven >= p.min_distance else RecoveryOutcome.IMPASSABLE
            return RecoveryResult(outcome, f"backed up {driven:.2f} m, then the ground behind is blocked")

        return run_guarded(request, self.clock, p.time_limit, step)
