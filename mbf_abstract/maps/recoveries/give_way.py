"""Give way: drive out of the way that the robot came along and would go on, to where another one can pass, and wait.

When to use: in ``escalation_behaviors``, against whoever stands head on in a corridor or a door and waits for us. When
not: things that never move; plan around those. Give two robots of the same kind different seeds: both may give way at
first, the waits they draw let one go on before the other.

The way is the track that the robot has driven, straight ahead and straight on behind the track. The nearest place is
searched where the base stands ``distance`` from all of it, by the shortest manoeuvre on which the outline touches
nothing the map knows: back into a bay, around a corner, or a step aside in a hall; see ``maps.manoeuvres``. It is
driven slowly, each command checked as in every recovery; afterwards the robot stands for a time that is drawn anew for
each run. Where there is no such place it ends with IMPASSABLE at once.

The server's ``recovery_patience`` must leave time for the drive and the wait.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist, normalize_angle
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.geometry.arithmetic import norm, rotated_back
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.guarded_motion import GuardedMotionParameters, GuardedRecovery
from mbf_abstract.maps.manoeuvres import PlanarPose, Step, find_manoeuvre
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.maps.recoveries.wait import stand
from mbf_abstract.outcomes import RecoveryOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RecoveryRequest, RecoveryResult

LOOKAHEAD = 0.25  # m to the point of the manoeuvre that is steered to
WAY_SPACING = 0.1  # m
LEAVING = 0.3  # m around a robot that touches something
END_REACHED, HEADING_REACHED = 0.04, 0.05  # m, rad


class GiveWayParameters(GuardedMotionParameters):
    """Parameters of ``give_way``."""

    distance: float = parameter(
        0.8, "How far its base must stand from its way: half of both widths and a margin.", unit="m", gt=0.0, le=5.0
    )
    reach: float = parameter(4.0, "Longest manoeuvre to such a place.", unit="m", gt=0.0, le=20.0)
    speed: float = parameter(0.3, "How fast, forward and backward.", unit="m/s", gt=0.0, le=2.0)
    yaw_rate: float = parameter(0.8, "Yaw rate limit.", unit="rad/s", gt=0.0, le=3.0)
    wait: float = parameter(3.0, "How long to stand there, at least.", unit="s", ge=0.0, le=600.0)
    random_extra: float = parameter(3.0, "Stand up to this much longer, by chance.", unit="s", ge=0.0, le=600.0)


class GiveWayRecovery(GuardedRecovery):
    """Pulls out, and waits until the other one may have passed."""

    Parameters: ClassVar[type[PluginParameters]] = GiveWayParameters
    parameters: GiveWayParameters

    def recover(self, request: RecoveryRequest) -> RecoveryResult:
        """Search the place, drive there section by section, and wait."""
        p, begin = self.parameters, request.motion.pose()
        steps = self._manoeuvre(begin, request)
        if request.cancel_token.cancelled:
            return RecoveryResult(RecoveryOutcome.CANCELED, request.cancel_token.reason)
        if steps is None:
            text = f"no place {p.distance:g} m beside its way within a manoeuvre of {p.reach:g} m"
            return RecoveryResult(RecoveryOutcome.IMPASSABLE, text)
        frame = Transform(begin.position, begin.orientation, begin.frame_id, "begin")
        at: PlanarPose = (0.0, 0.0, 0.0)
        for gear, section in groupby(steps, key=lambda step: step.gear):
            planned = [at, *_poses(section)]
            poses = [frame.apply_to_pose(Pose.planar(x, y, yaw, frame_id="begin")) for x, y, yaw in planned]
            result = self._turn(request, poses[-1]) if gear == 0 else self._follow(request, poses, gear)
            if not result.success:
                return result
            at = planned[-1]
        place = request.motion.pose()
        seconds = p.wait + p.random_extra * float(self.rng.random())
        result = stand(request, seconds)
        return replace(result, message=f"{result.message} at ({place.x:.2f}, {place.y:.2f}), beside its way")

    # -------------------------------------------------------------------------------------------------- the search
    def _manoeuvre(self, begin: Pose, request: RecoveryRequest) -> list[Step] | None:
        """Shortest manoeuvre in the plane of the robot at ``begin`` to a place beside its way."""
        start, way = self.on_map(begin), self._way(begin)
        frame = Transform(start.position, start.orientation, start.frame_id, "begin")
        check = self.navigation_map.pose_check(PlaceQuery(use_padded_footprint=True))
        touches = check(start).state > CellState.INSCRIBED

        def is_free(pose: PlanarPose) -> bool:
            x, y, yaw = pose
            if touches and math.hypot(x, y) <= LEAVING:
                return True  # it is let out of what it touches; each command is checked when it is driven
            return check(frame.apply_to_pose(Pose.planar(x, y, yaw, frame_id="begin"))).state <= CellState.INSCRIBED

        def left(pose: PlanarPose) -> float:
            return max(self.parameters.distance - float(norm(way - np.array(pose[:2])).min()), 0.0)

        token = request.cancel_token
        return find_manoeuvre(is_free, left, self.parameters.reach, self.min_turning_radius, lambda: token.cancelled)

    def _way(self, begin: Pose) -> NDArray[np.float64]:
        """Points (n, 2) [m] of the way in the plane of the robot: the track behind it, and straight on at both ends."""
        length = self.parameters.reach + self.parameters.distance
        on = np.arange(0.0, length, WAY_SPACING)[:, None]
        track = rotated_back(begin.rotation, self.robot.recent_track()[::-1] - np.asarray(begin.position))[:, :2]
        track = np.concatenate([np.zeros((1, 2)), track])
        driven = np.concatenate([[0.0], np.cumsum(norm(np.diff(track, axis=0)))])
        track = track[driven <= length]
        older = track[norm(track - track[-1]) > WAY_SPACING]
        back = track[-1] - older[-1] if len(older) else np.array([-1.0, 0.0])
        return np.concatenate([on * (1.0, 0.0), track, track[-1] + on * back / norm(back)])

    # --------------------------------------------------------------------------------------------------- the drive
    def _follow(self, request: RecoveryRequest, poses: list[Pose], gear: int) -> RecoveryResult:
        """Drive along poses in one gear, by pure pursuit; the last one is prolonged for the point steered to."""
        last = np.asarray(poses[-1].position) + poses[-1].rotation[:, 0] * (gear * LOOKAHEAD)
        points = np.array([*(pose.position for pose in poses), last])
        tracker = PathTracker(Path.from_points(points, frame_id=poses[0].frame_id))
        speed, limit = gear * self.parameters.speed, self.parameters.yaw_rate

        def finished(pose: Pose) -> bool:
            tracker.update(pose.position)
            return tracker.remaining <= LOOKAHEAD + END_REACHED

        def velocity(pose: Pose) -> Twist:
            _, curvature = arc_to(pose, tracker.point_at(tracker.progress + LOOKAHEAD))
            return Twist.planar(vx=speed, wz=max(-limit, min(limit, speed * curvature)))

        return self.drive(request, velocity, finished)

    def _turn(self, request: RecoveryRequest, end: Pose) -> RecoveryResult:
        """Turn on the spot to a heading."""

        def left(pose: Pose) -> float:
            return normalize_angle(end.yaw - pose.yaw)

        def velocity(pose: Pose) -> Twist:
            limit = self.parameters.yaw_rate
            return Twist.planar(wz=max(-limit, min(limit, 2.0 * left(pose))))

        return self.drive(request, velocity, lambda pose: abs(left(pose)) <= HEADING_REACHED)


def _poses(steps: Iterable[Step]) -> list[PlanarPose]:
    return [pose for step in steps for pose in step.poses]
