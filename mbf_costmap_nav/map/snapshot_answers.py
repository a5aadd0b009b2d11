"""What a layered costmap answers from its snapshot: the places and the motions of the core's map contract.

No lock is held while a question is answered.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import FloatArray, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.layered_map import LayeredMap
from mbf_abstract.maps.queries import PlaceCheck, PlaceQuery, PlaneCheck, PoseAnswer
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_costmap_nav.grid.contact import contact_depth
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.motion_check import blocked_cells, nearest_lethal, obstacle_ahead
from mbf_costmap_nav.kernels.map.path_poses import first_off_grid
from mbf_costmap_nav.map import pose_checks

ROUND = 1.05
"""An outline whose radii differ by less than this factor is that of a round robot."""


class SnapshotAnswers(LayeredMap):
    """The part of a ``LayeredCostmap`` that needs no more than its snapshot and its footprints.

    Attributes
    ----------
    footprint, unpadded_footprint : Footprint
        The robot's outline with and without padding.
    """

    footprint: Footprint
    unpadded_footprint: Footprint
    knows_outline = True
    rolling_window: bool
    same_storey = math.inf

    @abstractmethod
    def snapshot(self) -> Costmap:
        """Read-only copy of the map as of the last update; the same object until the map changes."""

    @property
    def inscribed_radius(self) -> float:
        """Distance [m] from the base to the nearest side of the padded footprint."""
        return self.footprint.inscribed_radius

    @property
    def robot_box(self) -> RobotBox:
        """The box around the padded footprint; a circle for a round robot."""
        outline = self.footprint
        if len(outline.vertices) < 3:
            return RobotBox.disc(0.0)
        if outline.circumscribed_radius < ROUND * outline.inscribed_radius:
            return RobotBox.disc(outline.circumscribed_radius)
        return RobotBox.around(outline.vertices)

    @property
    def robot_outline(self) -> FloatArray:
        """Corners (n, 2) [m] of the padded footprint."""
        return self.footprint.vertices

    def point_check(self) -> PlaceCheck:
        """State and cost of the cells of points."""
        costmap = self.snapshot()
        return lambda pose: pose_checks.check_point(costmap, pose.x, pose.y)

    def first_outside(self, positions: FloatArray) -> int:
        """The first position off the grid; not asked of a window, which may have moved since the path was planned."""
        if self.rolling_window:
            return -1
        grid = self.snapshot()
        size = grid.width, grid.height, grid.resolution, grid.origin_x, grid.origin_y
        return int(first_off_grid(np.ascontiguousarray(positions, dtype=np.float64), *size))

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and summed cost of the outline, see ``pose_checks.pose_check``."""
        if center_only:
            return pose_checks.pose_check(self.snapshot(), Footprint([]), replace(query, safety_dist=0.0))
        return pose_checks.pose_check(self.snapshot(), self._outline(query), query)

    def plane_check(self, query: PlaceQuery, frame: Transform) -> PlaneCheck:
        """As ``pose_check`` says, which is all that paths are checked by; all poses in one kernel."""
        return pose_checks.plane_check(self.snapshot(), self._outline(query), frame, query.safety_dist)

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Nearest pose where the outline fits, see ``pose_checks.find_valid_pose``."""
        tolerances = dist_tolerance, angle_tolerance
        return pose_checks.find_valid_pose(self.snapshot(), self._outline(query), pose, *tolerances, query)

    def _outline(self, query: PlaceQuery) -> Footprint:
        return self.footprint if query.use_padded_footprint else self.unpadded_footprint

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where the footprint would touch more than now if the robot kept ``command`` for ``duration`` [s].

        A round robot that turns about its centre touches nothing new, whatever the polygon does that stands for it.
        """
        return self._obstacle_ahead(pose, command, duration)

    def obstacle_on_path(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``, where the footprint may reach over the end of the map."""
        return self._obstacle_ahead(pose, command, duration, may_overhang=True)

    def _obstacle_ahead(self, pose: Pose, command: Twist, duration: float, may_overhang: bool = False) -> str:
        costmap = self.snapshot()
        if command.speed == 0.0 and self.unpadded_footprint.is_circle:
            blocked, covered = blocked_cells(costmap, self.footprint, pose.x, pose.y, pose.yaw)
            if blocked < covered:  # where all of it lies on obstacles only ``escape`` may move
                return ""
        return obstacle_ahead(costmap, self.footprint, pose, command, duration, may_overhang=may_overhang)

    def contact_depth(self, pose: Pose) -> float:
        """How deep [m] the outline lies in lethal cells, see ``grid.contact``; 0 where it touches none."""
        return contact_depth(self.snapshot(), self.footprint, pose)

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the centre of the nearest lethal cell; None if none is ``within`` [m]."""
        return nearest_lethal(self.snapshot(), pose, within)
