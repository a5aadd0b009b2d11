"""The mesh server's answers to ``MapQueries``: bring poses into the map's frame and ask ``pose_checks``."""

from __future__ import annotations

from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_abstract.time.clock import Clock
from mbf_mesh_nav.map import pose_checks
from mbf_mesh_nav.map.mesh_map import MeshMap

NO_EXTRAS = PlaceQuery()


class MeshQueries:
    """Answers for the one map of a mesh server; a query's ``local`` makes no difference.

    Parameters
    ----------
    mesh_map : MeshMap
    robot : RobotInformation
        Where the robot is, for questions without a pose.
    transforms : TransformBuffer
        Takes poses and paths into the frame of the map.
    clock : Clock
    """

    def __init__(self, mesh_map: MeshMap, robot: RobotInformation, transforms: TransformBuffer, clock: Clock) -> None:
        self._clock = clock
        self._map = mesh_map
        self._robot = robot
        self._transforms = transforms

    def check_point(self, point: Pose, local: bool = False) -> PlaceAnswer:
        """State and interpolated cost of the surface at a point."""
        return pose_checks.check_point(self._map, self._there(point))

    def check_pose(self, pose: Pose | None, query: PlaceQuery = NO_EXTRAS) -> PlaceAnswer:
        """State and summed cost below the robot's disc at ``pose`` (None = where the robot is)."""
        return pose_checks.check_pose(self._map, self._there(pose), query)

    def check_path(
        self,
        path: Path,
        query: PlaceQuery = NO_EXTRAS,
        return_on: CellState | None = None,
        skip_poses: int = 0,
        path_cells_only: bool = False,
    ) -> PathAnswer:
        """Worst state and summed cost along a path."""
        there = self._transforms.transform_path(path, self._map.frame_id)
        return pose_checks.check_path(self._map, there, query, return_on, skip_poses, path_cells_only)

    def find_valid_pose(
        self, pose: Pose | None, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery = NO_EXTRAS
    ) -> PoseAnswer:
        """Nearest pose within ``dist_tolerance`` [m] where the robot fits, in the map's frame."""
        return pose_checks.find_valid_pose(self._map, self._there(pose), dist_tolerance, query)

    def clear_map(self) -> None:
        """Forget all sensed obstacles."""
        self._map.clear()

    def update_map(self) -> None:
        """Take in what sensors have seen since the last update."""
        self._map.update(None, self._clock.now())

    def _there(self, pose: Pose | None) -> Pose:
        return self._transforms.transform_pose(pose or self._robot.pose(), self._map.frame_id)
