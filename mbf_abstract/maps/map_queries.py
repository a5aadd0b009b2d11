"""Map-independent questions: what a point, a pose or a path costs, and where the robot fits.

An executive asks these before it sends a goal. Poses may be in any known frame; TransformError where it is not known.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

from mbf_abstract.drive.robot import RobotInformation
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.arrival_tolerance import plan_tolerance_problem
from mbf_abstract.maps.queries import (
    AS_CONFIGURED,
    CellState,
    PathAnswer,
    PlaceAnswer,
    PlaceCheck,
    PlaceQuery,
    PoseAnswer,
)
from mbf_abstract.maps.served_map import ServedMap
from mbf_abstract.maps.tracking.blocking import Blockage, blockages
from mbf_abstract.maps.tracking.objects import TrackedObject

Served: TypeAlias = ServedMap[Any]


class MapQueries:
    """The questions to the one or two maps of a server.

    Parameters
    ----------
    global_map : ServedMap
        The map plans are made on.
    local_map : ServedMap
        The map the robot drives on; the same one where a server has only one.
    robot : RobotInformation
        Where the robot is, for questions without a pose.
    transforms : TransformBuffer
        Takes poses and paths into the frames of the maps.
    """

    def __init__(
        self, global_map: Served, local_map: Served, robot: RobotInformation, transforms: TransformBuffer
    ) -> None:
        self._global, self._local, self._robot, self._transforms = global_map, local_map, robot, transforms

    def check_point(self, point: Pose, local: bool = False) -> PlaceAnswer:
        """State and cost of one point."""
        served = self._local if local else self._global
        with served.in_use():
            check: PlaceCheck = served.map.point_check()
            return check(self._on(served, point))

    def check_pose(self, pose: Pose | None, query: PlaceQuery = AS_CONFIGURED) -> PlaceAnswer:
        """State and summed cost of the robot's outline at ``pose`` (None = where the robot is)."""
        served = self._of(query)
        with served.in_use():
            check: PlaceCheck = served.map.pose_check(query)
            return check(self._on(served, pose))

    def check_path(
        self,
        path: Path,
        query: PlaceQuery = AS_CONFIGURED,
        return_on: CellState | None = None,
        skip_poses: int = 0,
        path_cells_only: bool = False,
    ) -> PathAnswer:
        """Worst state and summed cost along a path, all on one state of the map; see ``check_path``.

        With ``path_cells_only`` the points of the path are looked at; outline and safety distance are ignored.
        """
        served = self._of(query)
        with served.in_use():
            check = served.map.pose_check(query, center_only=path_cells_only)
            return check_path(check, self._transforms.transform_path(path, served.map.frame_id), return_on, skip_poses)

    def check_poses(self, path: Path, query: PlaceQuery = AS_CONFIGURED) -> tuple[PlaceAnswer, ...]:
        """State and summed cost of the robot's outline at each pose of a path, all on one state of the map."""
        served = self._of(query)
        with served.in_use():
            check: PlaceCheck = served.map.pose_check(query)
            return tuple(check(pose) for pose in self._transforms.transform_path(path, served.map.frame_id))

    def find_valid_pose(
        self, pose: Pose | None, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery = AS_CONFIGURED
    ) -> PoseAnswer:
        """Nearest pose within the tolerances [m, rad] where the robot fits, in the map's frame; inf = anywhere.

        Raises
        ------
        ValueError
            A tolerance is negative, no number, or beyond 1000 m or a full turn without being inf.
        """
        if problem := plan_tolerance_problem(dist_tolerance, angle_tolerance):
            raise ValueError(problem)
        served = self._of(query)
        with served.in_use():
            there = self._on(served, pose)
            answer: PoseAnswer = served.map.find_valid_pose(there, dist_tolerance, angle_tolerance, query)
            return answer

    def tracked_objects(self) -> tuple[TrackedObject, ...]:
        """What moves, or has stopped, as the map knows it that the robot drives on, else the one plans are made on.

        In the frame of that map; empty if no layer tracks objects.
        """
        return self._tracking()[1]

    def what_blocks(self, path: Path, within_time: float = 2.0, margin: float = 0.0) -> tuple[Blockage, ...]:
        """Tracked objects on a path, or on their way onto it, the first along the path first; empty if there is none.

        Parameters
        ----------
        within_time : float
            How far ahead [s] the places of moving objects count.
        margin : float
            Who is nearer than this [m] to the outline of the robot on the path blocks it, too.

        Raises
        ------
        ValueError
            The time or the margin is negative or not finite.
        """
        for name, value, unit in (("within_time", within_time, "s"), ("margin", margin, "m")):
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must be 0 {unit} or more and finite, got {value}")
        served, objects = self._tracking()
        if not objects or len(path) == 0:
            return ()
        there = self._transforms.transform_path(path, served.map.frame_id)
        box = served.map.robot_box
        box = box._replace(radius=box.radius + margin)
        return blockages(box, there, objects, within_time, served.map.same_storey)

    def _tracking(self) -> tuple[Served, tuple[TrackedObject, ...]]:
        """The first map that knows objects, the local one first, and they."""
        for served in self._chosen(None):
            with served.in_use():
                if objects := served.tracked_objects():
                    return served, objects
        return self._global, ()

    def clear_map(self, local: bool | None = None) -> None:
        """Forget what sensors have marked, and update the maps, the local one first.

        A plan waits for the next scans, no longer than a sensor may be silent. Nothing drives until they have come.

        ``local`` chooses the local or the global map only; None = both.
        """
        for served in self._chosen(local):
            served.map.clear()
        self.update_map(local)

    def clear_area(self, size: float, local: bool | None = None, *, inside: bool = True) -> None:
        """Do the same within a square of side ``size`` [m] around the robot, or everywhere else.

        Raises
        ------
        ValueError
            The size is not positive and finite.
        RobotStateError
            It is not known where the robot is.
        """
        if not 0.0 < size < math.inf:
            raise ValueError(f"the area to clear must have a finite size above 0 m, got {size}")
        for served in self._chosen(local):
            served.map.clear_area(self._on(served, None), size, inside=inside)
        self.update_map(local)

    def update_map(self, local: bool | None = None) -> None:
        """Bring the maps up to date now, the local one first."""
        for served in self._chosen(local):
            with served.in_use():
                served.update()

    def _chosen(self, local: bool | None) -> list[Served]:
        """The local map, the global one, or both; once where a server has only one."""
        if local is not None or self._local is self._global:
            return [self._local if local else self._global]
        return [self._local, self._global]

    def _of(self, query: PlaceQuery) -> Served:
        return self._local if query.local else self._global

    def _on(self, served: Served, pose: Pose | None) -> Pose:
        return self._transforms.transform_pose(pose or self._robot.pose(), served.map.frame_id)


def check_path(check: PlaceCheck, path: Path, return_on: CellState | None = None, skip_poses: int = 0) -> PathAnswer:
    """Worst state and summed cost over every ``skip_poses + 1``-th pose of a path in the frame of the map.

    Parameters
    ----------
    return_on : CellState, optional
        Stop after the pose at which the worst state reaches this one; None or FREE = never.
    skip_poses : int
        Poses to leave out after each checked one.

    Raises
    ------
    ValueError
        ``skip_poses`` is negative.
    """
    if skip_poses < 0:
        raise ValueError(f"skip_poses must not be negative, got {skip_poses}")
    last, state, cost = -1, CellState.FREE, 0.0
    for last in range(0, len(path), skip_poses + 1):
        answer = check(path[last])
        state, cost = max(state, answer.state), cost + answer.cost
        if return_on and state >= return_on:
            break
    return PathAnswer(last, state, cost)
