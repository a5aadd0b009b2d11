"""Following a path: where the robot is on it, what lies ahead, and whether it has arrived. Shared by all controllers.

The progress is that of the core's ``PathTracker``, seen from above. The plan stays in the frame it came in; where the
costmap is in another one (a local map in odom), each cycle sees plan and pose through the newest transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, normalize_angle
from mbf_abstract.geometry.arithmetic import plane_rotation, rotated_back
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.controllers.failures import collision, missed_path, no_path, outside_map
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, ControlResult
from mbf_costmap_nav.grid.contact import first_refused
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.plugins import CostmapContext, CostmapController

FloatArray = NDArray[np.float64]

LIMIT_SLACK = 1e-12
"""A value exactly at its limit counts as within, whatever rounding does to the difference."""


def to_base_frame(points: FloatArray, pose: Pose) -> FloatArray:
    """Points (n, 2) of the map expressed in the base frame of a robot at ``pose``."""
    return rotated_back(plane_rotation(pose.yaw), points - (pose.x, pose.y))


@dataclass(frozen=True)
class ControlCycle:
    """What a controller works on in one cycle.

    Attributes
    ----------
    tracker : PathTracker
        The plan and the progress on it.
    costmap : Costmap
        Snapshot of this cycle.
    goal_tolerance : float
        Distance [m] from the goal that counts as arrived.
    speed_limit : float
        Largest speed [m/s] the maps allow here.
    limit_factor : float
        At least 1: how much wider the controller's own limits are while a recovery relaxes them.
    touches : bool
        Whether the footprint touches an obstacle where the robot stands; then it may only move out of it.
    """

    request: ControlRequest
    tracker: PathTracker
    costmap: Costmap
    footprint: FootprintCheck
    goal_tolerance: float
    speed_limit: float
    limit_factor: float = 1.0
    touches: bool = False

    def first_collision(self, poses: FloatArray) -> int:
        """Index of the first of poses (n, 3: x, y, yaw) that the robot must not come to, or -1."""
        if self.touches:
            return first_refused(self.costmap, self.footprint, self.request.pose, poses)
        return self.footprint.first_collision(self.costmap, poses)

    def first_collision_of_turn(self, poses: FloatArray) -> int:
        """As ``first_collision``, for poses of a turn on the spot."""
        return (
            self.first_collision(poses) if self.touches else self.footprint.first_collision_of_turn(self.costmap, poses)
        )


class PathFollower(CostmapController):
    """Base of the controllers: keeps the plan, checks frame, map and collision once, decides on arrival."""

    leaves_contacts: ClassVar[bool] = False
    """Whether it checks by ``ControlCycle.first_collision`` where it drives; without it, it stands in a collision."""

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self.tracker: PathTracker | None = None
        self.goal_dist_tolerance = 0.1
        self._footprint: FootprintCheck | None = None

    @property
    def full_speed(self) -> float:
        """Largest speed [m/s] where no layer limits it; every controller that drives has one."""
        return math.inf

    @property
    def is_leaving(self) -> bool:
        """Whether the robot is leaving a contact; those that leave none never are."""
        return False

    def checked_footprint(self) -> Footprint:
        """Outline that must not touch a lethal cell; the costmap's padded one. A new object means a new outline."""
        return self.costmap.footprint

    def set_plan(self, path: Path) -> bool:
        """Take over a path of at least one pose, in a frame with a transform to the costmap's."""
        if len(path) == 0:
            return self.refuse("it has no poses")
        if not self.transforms.can_transform(self.costmap.frame_id, path.frame_id):
            return self.refuse(f"no transform leads from its frame {path.frame_id!r} to {self.costmap.frame_id!r}")
        self.tracker = PathTracker(path, dimensions=2)
        return True

    def is_goal_reached(self, pose: Pose, dist_tolerance: float, angle_tolerance: float) -> bool:
        """Whether ``pose`` is within both tolerances of the last pose, and the path has been driven to its end."""
        self.goal_dist_tolerance = dist_tolerance
        if self.tracker is None:
            return False
        self.tracker.update((pose.x, pose.y))
        goal = self.tracker.goal
        if not self.tracker.has_arrived(dist_tolerance):
            return False
        near = math.hypot(pose.x - goal.x, pose.y - goal.y) <= dist_tolerance + LIMIT_SLACK
        return near and abs(normalize_angle(goal.yaw - pose.yaw)) <= angle_tolerance + LIMIT_SLACK

    def begin_cycle(self, request: ControlRequest) -> ControlCycle | ControlResult:
        """Update the progress and check what every controller needs; a result is the failure to hand on."""
        if self.tracker is None:
            return no_path()
        try:
            request, tracker, limit = self._on_costmap(request, self.tracker)
        except TransformError as error:
            return ControlResult(ExePathOutcome.TF_ERROR, str(error))
        if self.costmap is not self.local_costmap and (problem := self.costmap.stale_reason(self.clock.now())):
            return ControlResult(ExePathOutcome.MAP_ERROR, problem)  # the server looks at the local map only
        pose, costmap = request.pose, self.costmap.snapshot()
        if not costmap.contains(pose.x, pose.y):
            return outside_map(f"({pose.x:.2f}, {pose.y:.2f})", str(costmap))
        footprint = self.checked_footprint()
        if self._footprint is None or self._footprint.footprint is not footprint:
            self._footprint = FootprintCheck(footprint, costmap.resolution)
        touches = self._footprint.collides(costmap, pose.x, pose.y, pose.yaw)
        if touches and not self.leaves_contacts:
            return collision(f"it stays at ({pose.x:.2f}, {pose.y:.2f}, {pose.yaw:.2f} rad)")
        factor = self.relaxation.slack(self.clock.now()).controller_factor
        parameters: Any = self.parameters
        farthest = parameters.max_path_distance if hasattr(parameters, "max_path_distance") else math.inf
        if (missed := missed_path(tracker, farthest * factor)) and not self.is_leaving:
            return missed
        tolerance = self.goal_dist_tolerance
        return ControlCycle(request, tracker, costmap, self._footprint, tolerance, limit, factor, touches)

    def _on_costmap(self, request: ControlRequest, tracker: PathTracker) -> tuple[ControlRequest, PathTracker, float]:
        """Update the progress; return request and plan in the costmap's frame, and the speed limit [m/s] there."""
        pose = self.transforms.transform_pose(request.pose, tracker.path.frame_id)
        tracker.update((pose.x, pose.y))
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
