"""The costmap server's answers to ``MapQueries``: choose the map, bring poses into its frame, keep it alive, ask.

The questions themselves are in ``pose_checks``; this class adds what they leave to the server.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from mbf_abstract.drive.robot import RobotInformation, RobotStateError
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer, TransformError
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_abstract.time.clock import Clock
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map import pose_checks
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap

NO_EXTRAS = PlaceQuery()


def _always_running(_: LayeredCostmap) -> AbstractContextManager[None]:
    return nullcontext()


class CostmapQueries:
    """Answers for the two maps of a costmap server.

    Parameters
    ----------
    global_costmap, local_costmap : LayeredCostmap
    robot : RobotInformation
        Where the robot is, for questions without a pose and for updates.
    transforms : TransformBuffer
        Takes poses and paths into the frames of the maps.
    clock : Clock
    using : callable
        Context manager that keeps one map alive while it is asked (``MapLifecycle.in_use``).
    """

    def __init__(
        self,
        global_costmap: LayeredCostmap,
        local_costmap: LayeredCostmap,
        robot: RobotInformation,
        transforms: TransformBuffer,
        clock: Clock,
        using: Callable[[LayeredCostmap], AbstractContextManager[None]] = _always_running,
    ) -> None:
        self._global, self._local = global_costmap, local_costmap
        self._transforms = transforms
        self._robot = robot
        self._clock = clock
        self._using = using

    def check_point(self, point: Pose, local: bool = False) -> PlaceAnswer:
        """State and cost of one point."""
        costmap = self._local if local else self._global
        with self._using(costmap):
            there = self._transforms.transform_pose(point, costmap.frame_id)
            return pose_checks.check_point(costmap.snapshot(), there.x, there.y)

    def check_pose(self, pose: Pose | None, query: PlaceQuery = NO_EXTRAS) -> PlaceAnswer:
        """State and summed cost of the robot's outline at ``pose`` (None = where the robot is)."""
        costmap = self._map_of(query)
        with self._using(costmap):
            return pose_checks.check_pose(
                costmap.snapshot(), _outline(costmap, query), self._there(pose, costmap), query
            )

    def check_path(
        self,
        path: Path,
        query: PlaceQuery = NO_EXTRAS,
        return_on: CellState | None = None,
        skip_poses: int = 0,
        path_cells_only: bool = False,
    ) -> PathAnswer:
        """Worst state and summed cost along a path."""
        costmap = self._map_of(query)
        with self._using(costmap):
            return pose_checks.check_path(
                costmap.snapshot(),
                _outline(costmap, query),
                self._transforms.transform_path(path, costmap.frame_id),
                query,
                return_on=return_on,
                skip_poses=skip_poses,
                path_cells_only=path_cells_only,
            )

    def find_valid_pose(
        self, pose: Pose | None, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery = NO_EXTRAS
    ) -> PoseAnswer:
        """Nearest pose within the tolerances [m, rad] where the robot fits, in the map's frame."""
        costmap = self._map_of(query)
        with self._using(costmap):
            return pose_checks.find_valid_pose(
                costmap.snapshot(),
                _outline(costmap, query),
                self._there(pose, costmap),
                dist_tolerance,
                angle_tolerance,
                query,
            )

    def clear_map(self) -> None:
        """Clear all layers of both maps, the local one first, and update them."""
        for costmap in (self._local, self._global):
            costmap.clear()
        self.update_map()

    def update_map(self) -> None:
        """Bring both maps up to date now, the local one first."""
        for costmap in (self._local, self._global):
            with self._using(costmap):
                self._update(costmap)

    def _update(self, costmap: LayeredCostmap) -> None:
        try:
            pose = self._there(None, costmap)
        except (RobotStateError, TransformError):
            pose = None  # a rolling map then keeps its place
        costmap.update(pose, self._clock.now())

    def _map_of(self, query: PlaceQuery) -> LayeredCostmap:
        return self._local if query.local else self._global

    def _there(self, pose: Pose | None, costmap: LayeredCostmap) -> Pose:
        return self._transforms.transform_pose(pose or self._robot.pose(), costmap.frame_id)


def _outline(costmap: LayeredCostmap, query: PlaceQuery) -> Footprint:
    return costmap.footprint if query.use_padded_footprint else costmap.unpadded_footprint
