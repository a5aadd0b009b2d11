"""The map-independent questions for a round robot, on any map that knows one thing: how a single place is.

Derive from ``DiscQueries`` in a map backend of your own and write ``place`` and ``candidates``. Not for robots whose
outline matters: their heading does, too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

import numpy as np

from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.geometry import FloatArray, Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery, PoseAnswer

ROBOT_AS_IT_IS = PlaceQuery()


class DiscQueries(ABC):
    """Answers for a disc; a ``MapQueries``.

    Parameters
    ----------
    frame_id : str
        Frame of the map.
    robot : RobotInformation
        Where the robot is, for questions without a pose.
    transforms : TransformBuffer
        For poses of other frames.
    """

    def __init__(self, frame_id: str, robot: RobotInformation, transforms: TransformBuffer) -> None:
        self._frame_id, self._robot, self._transforms = frame_id, robot, transforms

    @abstractmethod
    def place(self, x: float, y: float, safety_dist: float) -> PlaceAnswer:
        """State and cost of a place of the map's frame [m], INSCRIBED where the grown disc touches something.

        ``safety_dist`` [m] is how much the disc is grown.
        """

    @abstractmethod
    def candidates(self, x: float, y: float, dist_tolerance: float) -> FloatArray:
        """Places (n, 3) [m] where the robot might fit, in any order; those beyond the tolerance [m] are passed over."""

    def clear_map(self) -> None:  # noqa: B027 - a map without sensors has nothing to forget
        """Forget what sensors have marked."""

    def update_map(self) -> None:  # noqa: B027 - a map without sensors is up to date
        """Bring the map up to date now."""

    def check_point(self, point: Pose, local: bool = False) -> PlaceAnswer:
        """State and cost of one point."""
        there = self._in_map(point)
        return self.place(there.x, there.y, 0.0)

    def check_pose(self, pose: Pose | None, query: PlaceQuery = ROBOT_AS_IT_IS) -> PlaceAnswer:
        """State and cost of the disc at ``pose`` (None = where the robot is): LETHAL where it touches something."""
        there = self._in_map(pose)
        answer = self.place(there.x, there.y, query.safety_dist)
        return replace(answer, state=CellState.LETHAL) if answer.state is CellState.INSCRIBED else answer

    def check_path(
        self,
        path: Path,
        query: PlaceQuery = ROBOT_AS_IT_IS,
        return_on: CellState | None = None,
        skip_poses: int = 0,
        path_cells_only: bool = False,
    ) -> PathAnswer:
        """Worst state and summed cost along a path; raises ValueError for a negative ``skip_poses``."""
        if skip_poses < 0:
            raise ValueError(f"skip_poses must not be negative, got {skip_poses}")
        worst, total, last = CellState.FREE, 0.0, -1
        for last in range(0, len(path), skip_poses + 1):
            answer = self.check_point(path[last]) if path_cells_only else self.check_pose(path[last], query)
            worst, total = max(worst, answer.state), total + answer.cost
            if return_on and worst >= return_on:
                break
        return PathAnswer(last, worst, total)

    def find_valid_pose(
        self, pose: Pose | None, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery = ROBOT_AS_IT_IS
    ) -> PoseAnswer:
        """Return the pose itself or the nearest free candidate within the tolerance; the heading stays.

        Raises
        ------
        ValueError
            The tolerance is negative or no number.
        """
        if not dist_tolerance >= 0.0:
            raise ValueError(f"dist_tolerance must not be negative, got {dist_tolerance}")
        there = self._in_map(pose)
        first = self.check_pose(there, query)
        if first.state is CellState.FREE:
            return PoseAnswer(first.state, first.cost, there)
        points = self.candidates(there.x, there.y, dist_tolerance)
        distances = np.hypot(points[:, 0] - there.x, points[:, 1] - there.y)
        for index in np.argsort(distances, kind="stable"):
            if distances[index] > dist_tolerance:
                break
            x, y, z = points[index].tolist()
            answer = self.place(x, y, query.safety_dist)
            if answer.state is CellState.FREE:
                return PoseAnswer(answer.state, answer.cost, Pose((x, y, z), there.orientation, there.frame_id))
        return PoseAnswer(first.state, first.cost, None)

    def _in_map(self, pose: Pose | None) -> Pose:
        return self._transforms.transform_pose(pose or self._robot.pose(), self._frame_id)
