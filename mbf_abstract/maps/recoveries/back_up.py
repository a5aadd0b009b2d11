"""Back up: straight, or along the track that the robot has driven; the simplest escape from a dead end.

With ``along_track`` it follows the driven track by pure pursuit in reverse, over ground that was free a moment ago;
where the track ends, is unknown or does not lie behind the robot (it has turned on the spot) it backs up straight. So
it does where the robot must not turn, as on a slope, or would touch something by turning. Ground of a mesh that costs
too much it crosses along the track, for the robot has just driven over it, but nothing lethal. Not for a long robot in
a narrow place: steering backward swings its front outward. Ends with IMPASSABLE before an obstacle.

When to use: the robot is too close to an obstacle in front to turn. When not: obstacles may have come up behind it that
no sensor sees.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_to, in_robot_frame
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult

LOOKAHEAD = 0.3
"""Distance [m] to the point of the track that is steered to."""
TRACK_GAP = 0.5
"""A track whose newest point is farther than this [m] from the robot is not where it came from."""
BESIDE_TRACK = 0.15
"""A robot within this [m] of its track drives over ground it has driven over."""


class BackUpParameters(GuardedMotionParameters):
    """Parameters of ``back_up``."""

    distance: float = parameter(0.5, "How far to back up.", unit="m", gt=0.0, le=10.0)
    speed: float = parameter(0.2, "Backward speed.", unit="m/s", gt=0.0, le=2.0)
    along_track: bool = parameter(False, "Follow the track that the robot has driven instead of a straight line.")
    yaw_rate: float = parameter(0.6, "Yaw rate limit along the track.", unit="rad/s", gt=0.0, le=3.0)


class BackUpRecovery(GuardedRecovery):
    """Backs up straight, or along the driven track."""

    Parameters: ClassVar[type[PluginParameters]] = BackUpParameters
    parameters: BackUpParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Back up until the distance is driven or something lies behind."""
        p = self.parameters
        begin = request.motion.pose()
        tracker = PathTracker(Path.from_points(self._track_back(begin), frame_id=begin.frame_id))
        driven = tracker.lengths[-2]  # what follows lies straight on, where the robot may never have been

        def finished(pose: Pose) -> bool:
            tracker.update(pose.position)
            return tracker.progress >= p.distance

        def obstacle(pose: Pose, command: Twist) -> str:
            reaches = tracker.progress + p.speed * p.check_ahead_time
            if reaches > driven or tracker.deviation > BESIDE_TRACK:
                return self.obstacle_ahead(pose, command)
            return self.navigation_map.obstacle_on_track(self.on_map(pose), command, p.check_ahead_time)

        def velocity(pose: Pose) -> Twist:
            if not p.along_track:
                return Twist.planar(vx=-p.speed)
            _, curvature = arc_to(pose, tracker.point_at(tracker.progress + LOOKAHEAD))
            along = Twist.planar(vx=-p.speed, wz=max(-p.yaw_rate, min(p.yaw_rate, -p.speed * curvature)))
            return Twist.planar(vx=-p.speed) if obstacle(pose, along) else along

        result = self.drive(request, velocity, finished, obstacle)
        return RecoveryResult(result.outcome, f"{result.message or 'done'}, backed up {tracker.progress:.2f} m")

    def _track_back(self, pose: Pose) -> NDArray[np.float64]:
        """Points (n, 3) behind the robot: its track from the newest point on, then straight on for ``distance``."""
        beyond, position = self.parameters.distance + LOOKAHEAD, np.asarray(pose.position)
        track = self.robot.recent_track()[::-1] if self.parameters.along_track else np.zeros((0, 3))
        far_enough = norm(track - position) >= LOOKAHEAD / 2.0
        track = track[np.argmax(far_enough) :] if far_enough.any() else track[:0]
        if len(track) == 0 or norm(track[0] - position) > TRACK_GAP or in_robot_frame(pose, track[0])[0] >= 0:
            return np.array([position, position - pose.rotation[:, 0] * beyond])
        last = track[-1] - (track[-2] if len(track) > 1 else position)
        return np.concatenate([[position], track, [track[-1] + last / norm(last) * beyond]])
