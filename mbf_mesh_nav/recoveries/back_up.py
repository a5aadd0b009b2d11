"""Drive back the way the robot came, over ground that was free a moment ago: the simplest way out of a dead end.

Follows the driven track by pure pursuit in reverse; where the track ends, is unknown or does not lie behind the robot
(it turned on the spot since) it backs up straight. Looks at the surface behind before every command and stops before
borders, lethal and costly faces. Helps when the robot stands too close to something in front; does not help when it
is hemmed in (IMPASSABLE at once).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult
from mbf_mesh_nav.motion.goal_approach import arc_to, clamp, in_robot_frame
from mbf_mesh_nav.motion.guarded_motion import GuardedRecovery, free_distance

TRACK_GAP = 0.5
"""A track whose newest point is farther than this [m] from the robot is not the way it came."""


class BackUpParameters(GuardedMotionParameters):
    """Parameters of ``mesh.back_up``."""

    distance: float = parameter(0.5, "How far to back up.", unit="m", gt=0.0, le=10.0)
    min_distance: float = parameter(0.1, "Less than this is a failure.", unit="m", ge=0.0)
    speed: float = parameter(0.2, "Backward speed.", unit="m/s", gt=0.0, le=2.0)
    yaw_rate: float = parameter(0.6, "Yaw rate limit.", unit="rad/s", gt=0.0, le=3.0)
    lookahead: float = parameter(0.3, "Distance to the point of the track that is steered to.", unit="m", gt=0.0)
    clearance: float = parameter(0.3, "Free ground kept behind the robot's centre.", unit="m", ge=0.0)
    cost_limit: float = parameter(1.0, "Ground whose cost reaches this is not entered.", gt=0.0, allow_inf=True)


class BackUpRecovery(GuardedRecovery):
    """Backs up along the driven track."""

    Parameters = BackUpParameters
    parameters: BackUpParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Back up until the distance is driven or the ground behind ends."""
        p = self.parameters
        begin = request.motion.pose()
        tracker = PathTracker(Path.from_points(self._way_back(begin), frame_id=self.mesh_map.frame_id))

        def velocity(pose: Pose) -> Twist | RecoveryResult:
            tracker.update(pose.position)
            driven = tracker.progress
            if driven >= p.distance:
                return RecoveryResult(RecoveryOutcome.SUCCESS, f"backed up {driven:.2f} m")
            spot = self.mesh_map.locate_one(pose.position, 1.0)
            if spot is None:
                return RecoveryResult(RecoveryOutcome.FAILURE, "the robot is more than 1 m from the surface")
            hardness = self.mesh_map.snapshot().hardness(p.cost_limit)
            target = tracker.point_at(driven + p.lookahead)
            direction = target - np.asarray(pose.position)
            if free_distance(self.mesh_map, hardness, spot, direction, p.clearance + 0.1) > p.clearance:
                _, curvature = arc_to(pose, target)
                return Twist.planar(vx=-p.speed, wz=clamp(-p.speed * curvature, p.yaw_rate))
            outcome = RecoveryOutcome.SUCCESS if driven >= p.min_distance else RecoveryOutcome.IMPASSABLE
            return RecoveryResult(outcome, f"backed up {driven:.2f} m, then the ground behind is blocked")

        return self.drive(request, velocity)

    def _way_back(self, pose: Pose) -> NDArray[np.float64]:
        """Points (n, 3) behind the robot: its track from the newest point on, then straight on for ``distance``."""
        p, position = self.parameters, np.asarray(pose.position)
        straight = -pose.rotation[:, 0] * (p.distance + p.lookahead)
        track = self.robot.recent_track()[::-1]
        far_enough = norm(track - position) >= p.lookahead / 2.0
        track = track[np.argmax(far_enough) :] if far_enough.any() else track[:0]
        if len(track) == 0 or norm(track[0] - position) > TRACK_GAP or in_robot_frame(pose, track[0])[0] >= 0:
            return np.array([position, position + straight])
        last = track[-1] - (track[-2] if len(track) > 1 else position)
        end = track[-1] + last / norm(last) * (p.distance + p.lookahead)
        return np.concatenate([[position], track, [end]])
