"""Following a path: where the robot is on it, what lies ahead, and whether it has arrived. Shared by all controllers.

A ``PathTracker`` owns one plan. Progress only grows and is searched in a window ahead of the last one, so a path that
crosses itself or passes its own goal early is followed in order. The plan stays in the frame it came in; where the
costmap is in another one (a local map in odom), each cycle sees plan and pose through the newest transform.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import plane_rotation, rotated_back
from mbf_abstract.geometry import Path, Pose, normalize_angle
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_abstract.transforms import Transform, TransformError
from mbf_costmap_nav.costmap import Costmap
from mbf_costmap_nav.footprint import Footprint
from mbf_costmap_nav.footprint_check import FootprintCheck
from mbf_costmap_nav.layered_costmap import LayeredCostmap
from mbf_costmap_nav.path_geometry import arc_lengths, closest_point
from mbf_costmap_nav.plugins import CostmapContext, CostmapController

FloatArray = NDArray[np.float64]

SEARCH_WINDOW = 2.0
"""How far ahead of the last progress [m] the nearest point of the path is searched."""
CUSP_REACHED = 0.1
"""This near [m] to a change of driving direction the robot goes on to the part of the path behind it."""
PATH_LENGTH_TOLERANCE = 1.0
"""With more than this left of the path [m] a pose near its end is not the arrival (the path comes back later)."""
LIMIT_SLACK = 1e-12
"""A value exactly at its limit counts as within, whatever rounding does to the difference."""


class PathTracker:
    """One plan and the robot's progress on it.

    Attributes
    ----------
    points : (n, 2) float64
        Positions of the path [m].
    lengths : (n,) float64
        Length along the path [m] at each pose.
    reverse : (n - 1,) bool
        Segments that are driven backward: they lead against the heading of their poses.
    progress : float
        Length along the path [m] of the robot's nearest point.
    cross_track : float
        Distance [m] of the robot from the path.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.points = np.ascontiguousarray(path.positions[:, :2])
        self.lengths = arc_lengths(self.points)
        self.reverse = _reverse_segments(path)
        self.cusps = np.concatenate([self.lengths[1:-1][self.reverse[1:] != self.reverse[:-1]], self.lengths[-1:]])
        self.progress = 0.0
        self.cross_track = 0.0
        self._segment = 0

    @property
    def goal(self) -> Pose:
        """Last pose of the path."""
        return self.path[len(self.path) - 1]

    @property
    def remaining(self) -> float:
        """Length [m] left along the path."""
        return float(self.lengths[-1]) - self.progress

    @property
    def driving_backward(self) -> bool:
        """Whether the current segment is driven in reverse."""
        return bool(len(self.reverse)) and bool(self.reverse[min(self._segment, len(self.reverse) - 1)])

    @property
    def to_cusp(self) -> float:
        """Length [m] to the next change of driving direction, or to the end."""
        return float(self.cusps[np.searchsorted(self.cusps, self.progress + 1e-6).clip(max=len(self.cusps) - 1)]) - (
            self.progress
        )

    def update(self, pose: Pose, window: float = SEARCH_WINDOW) -> None:
        """Move the progress on to the nearest point within ``window`` [m] ahead, but not past a distant cusp."""
        if self.to_cusp > CUSP_REACHED:
            window = min(window, self.to_cusp)
        last = int(np.searchsorted(self.lengths, self.progress + window, side="right"))
        segment, fraction = closest_point(self.points, (pose.x, pose.y), self._segment, max(last, self._segment + 1))
        following = min(segment + 1, len(self.points) - 1)
        along = self.lengths[segment] + fraction * (self.lengths[following] - self.lengths[segment])
        self._segment = segment
        self.progress = max(self.progress, float(along))
        nearest = self.point_at(self.progress)
        self.cross_track = math.hypot(pose.x - nearest[0], pose.y - nearest[1])

    def seen_from(self, transform: Transform) -> PathTracker:
        """Return the same plan and progress in the transform's parent frame."""
        moved = copy(self)
        moved.path = transform.apply_to_path(self.path)
        moved.points = np.ascontiguousarray(moved.path.positions[:, :2])
        return moved

    def point_at(self, length: float) -> FloatArray:
        """Point (2,) of the path at ``length`` [m] along it, clamped to its ends."""
        return np.array([np.interp(length, self.lengths, self.points[:, axis]) for axis in range(2)])

    def ahead(self, distance: float) -> FloatArray:
        """Points (m, 2) of the path from the progress on, over ``distance`` [m]; at least one."""
        end = min(self.progress + distance, float(self.lengths[-1]))
        inner = (self.lengths > self.progress + 1e-9) & (self.lengths < end - 1e-9)
        return np.vstack([self.point_at(self.progress), self.points[inner], self.point_at(end)])


def _reverse_segments(path: Path) -> NDArray[np.bool_]:
    """(n - 1,) bool: which segments lead against the heading of their poses.

    The first and the last pose carry the orientations that were asked for, not the direction of travel, so a segment
    is judged by an inner pose of its ends; a path of two poses is driven forward.
    """
    count = len(path)
    if count < 3:
        return np.zeros(max(count - 1, 0), dtype=bool)
    assert path.orientations is not None
    z, w = path.orientations[:, 2], path.orientations[:, 3]
    heading = np.column_stack([1.0 - 2.0 * z * z, 2.0 * w * z])
    inner = np.clip(np.arange(count - 1) + 1, 1, count - 2)
    return np.asarray(np.sum(np.diff(path.positions[:, :2], axis=0) * heading[inner], axis=1) < -1e-9)


def to_base_frame(points: FloatArray, pose: Pose) -> FloatArray:
    """Points (n, 2) of the map expressed in the base frame of a robot at ``pose``."""
    return rotated_back(plane_rotation(pose.yaw), points - (pose.x, pose.y))


@dataclass(frozen=True)
class ControlCycle:
    """What a controller works on in one cycle.

    Attributes
    ----------
    request : ControlRequest
    tracker : PathTracker
        The plan and the progress on it.
    costmap : Costmap
        Snapshot of this cycle.
    footprint : FootprintCheck
    goal_tolerance : float
        Distance [m] from the goal that counts as arrived.
    speed_limit : float
        Largest speed [m/s] the maps allow here.
    limit_factor : float
        At least 1: how much wider the controller's own limits are while a recovery relaxes them.
    """

    request: ControlRequest
    tracker: PathTracker
    costmap: Costmap
    footprint: FootprintCheck
    goal_tolerance: float
    speed_limit: float
    limit_factor: float = 1.0


class PathFollower(CostmapController):
    """Base of the controllers: keeps the plan, checks frame, map and collision once, decides on arrival."""

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self.tracker: PathTracker | None = None
        self.goal_dist_tolerance = 0.1
        self._footprint: FootprintCheck | None = None

    @property
    def full_speed(self) -> float:
        """Largest speed [m/s] where no layer limits it; every controller that drives has one."""
        return math.inf

    def checked_footprint(self) -> Footprint:
        """Outline that must not touch a lethal cell; the costmap's padded one. A new object means a new outline."""
        return self.costmap.footprint

    def set_plan(self, path: Path) -> bool:
        """Take over a path of at least one pose in a frame from which there is a way to the costmap's."""
        if len(path) == 0 or not self.transforms.can_transform(self.costmap.frame_id, path.frame_id):
            return False
        self.tracker = PathTracker(path)
        return True

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether ``pose`` is within both tolerances of the last pose, and the path has been driven up to it."""
        self.goal_dist_tolerance = dist_tolerance
        if self.tracker is None:
            return False
        self.tracker.update(pose)
        goal = self.tracker.goal
        if self.tracker.remaining > max(PATH_LENGTH_TOLERANCE, dist_tolerance):
            return False
        near = math.hypot(pose.x - goal.x, pose.y - goal.y) <= dist_tolerance + LIMIT_SLACK
        return near and abs(normalize_angle(goal.yaw - pose.yaw)) <= angle_tolerance + LIMIT_SLACK

    def begin_cycle(self, request: ControlRequest) -> ControlCycle | ControlResult:
        """Update the progress and check what every controller needs; a result is the failure to hand on."""
        if self.tracker is None:
            return ControlResult(ExePathOutcome.INVALID_PATH, "no path has been set")
        try:
            request, tracker, limit = self._on_costmap(request, self.tracker)
        except TransformError as error:
            return ControlResult(ExePathOutcome.TF_ERROR, str(error))
        if self.costmap is not self.local_costmap and (problem := self.costmap.currency_problem(self.clock.now())):
            return ControlResult(ExePathOutcome.MAP_ERROR, problem)  # the server looks at the local map only
        pose, costmap = request.pose, self.costmap.snapshot()
        if not costmap.contains(pose.x, pose.y):
            return ControlResult(ExePathOutcome.OUT_OF_MAP, f"robot ({pose.x:.2f}, {pose.y:.2f}) is outside {costmap}")
        footprint = self.checked_footprint()
        if self._footprint is None or self._footprint.footprint is not footprint:
            self._footprint = FootprintCheck(footprint, costmap.resolution)
        if self._footprint.collides(costmap, pose.x, pose.y, pose.yaw):
            text = f"the footprint at ({pose.x:.2f}, {pose.y:.2f}, {pose.yaw:.2f} rad) touches a lethal cell"
            return ControlResult(ExePathOutcome.COLLISION, text)
        factor = self.relaxation.slack(self.clock.now()).controller_factor
        return ControlCycle(request, tracker, costmap, self._footprint, self.goal_dist_tolerance, limit, factor)

    def _on_costmap(self, request: ControlRequest, tracker: PathTracker) -> tuple[ControlRequest, PathTracker, float]:
        """Update the progress; return request and plan in the costmap's frame, and the speed limit [m/s] there."""
        pose = self.transforms.transform_pose(request.pose, tracker.path.frame_id)
        tracker.update(pose)
        limit = min(self._speed_limit(pose, costmap) for costmap in (self.local_costmap, self.global_costmap))
        frame_id = self.costmap.frame_id
        if frame_id == pose.frame_id == request.pose.frame_id:
            return request, tracker, limit
        T_costmap_path = self.transforms.lookup(frame_id, pose.frame_id)
        return replace(request, pose=T_costmap_path.apply_to_pose(pose)), tracker.seen_from(T_costmap_path), limit

    def _speed_limit(self, pose: Pose, costmap: LayeredCostmap) -> float:
        """Speed [m/s] that the layers of a costmap allow at ``pose``, at most the full one."""
        there = self.on_map(pose, costmap)
        return min(self.full_speed, costmap.speed_limit(there.x, there.y, self.full_speed))
