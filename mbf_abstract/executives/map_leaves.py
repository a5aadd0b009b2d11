"""Leaves that ask the map or clear it: ``CheckPoint``, ``CheckPose``, ``CheckPath``, ``PathBlocked``, ``ClearMap``.

Each is done within one tick. A check succeeds where the place is no worse than ``worst``; its failure carries a code,
so that guards can react. Use them before a long drive; they cost a look-up, not a plan.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.nodes import Leaf
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome


class MapCheck(Leaf):
    """A question to the map whose answer is good enough or not.

    Parameters
    ----------
    worst : CellState
        The worst state that still passes.
    """

    failure_outcome: int = GetPathOutcome.BLOCKED_GOAL

    def __init__(self, name: str, worst: CellState = CellState.INSCRIBED) -> None:
        super().__init__(name)
        self.worst = worst

    @abstractmethod
    def ask(self) -> PlaceAnswer | PathAnswer:
        """Ask the map; may raise TransformError or RobotStateError."""

    def update(self) -> Status:
        """Succeed if the answer is no worse than ``worst``."""
        try:
            answer = self.ask()
        except (TransformError, RobotStateError) as error:
            return self._fail(GetPathOutcome.TF_ERROR, str(error))
        self.feedback_message = f"{answer.state.name}, cost {answer.cost:g}"
        if answer.state <= self.worst:
            return Status.SUCCESS
        return self._fail(self.failure_outcome, f"{self.name}: {self.feedback_message}")

    def _fail(self, outcome: int, message: str) -> Status:
        self.feedback_message = message
        self.mission.fail(ActionResult(int(outcome), message))
        return Status.FAILURE


class CheckPoint(MapCheck):
    """Whether one point of the map is free; without ``point`` the mission's target."""

    def __init__(self, name: str, point: Pose | None = None, local: bool = False) -> None:
        super().__init__(name)
        self.point = point
        self.local = local

    def ask(self) -> PlaceAnswer:
        """Look at one point."""
        point = self.point or self.mission.required_target()
        return self.mission.navigator.server.queries.check_point(point, self.local)


class CheckPose(MapCheck):
    """Whether the robot's outline fits at the mission's target, at a fixed pose, or where the robot is."""

    def __init__(
        self, name: str, pose: Pose | None = None, at_robot: bool = False, query: PlaceQuery | None = None
    ) -> None:
        super().__init__(name)
        self.pose = pose
        self.at_robot = at_robot
        self.query = query or PlaceQuery()
        self.failure_outcome = GetPathOutcome.BLOCKED_START if at_robot else GetPathOutcome.BLOCKED_GOAL

    def ask(self) -> PlaceAnswer:
        """Look under the outline."""
        pose = None if self.at_robot else self.pose or self.mission.required_target()
        return self.mission.navigator.server.queries.check_pose(pose, self.query)


class CheckPath(MapCheck):
    """Whether what is left of the mission's path is still free."""

    failure_outcome = ExePathOutcome.BLOCKED_PATH

    def __init__(self, name: str, query: PlaceQuery | None = None, skip_poses: int = 0) -> None:
        super().__init__(name)
        self.query = query or PlaceQuery()
        self.skip_poses = skip_poses

    def ask(self) -> PathAnswer:
        """Look under the outline along the path, up to the first bad pose."""
        first_bad = CellState(min(self.worst + 1, CellState.OUTSIDE))
        queries = self.mission.navigator.server.queries
        return queries.check_path(self.mission.path_to_follow(), self.query, first_bad, self.skip_poses)


class PathBlocked(Leaf):
    """Succeed if the next ``length`` [m] of the mission's path are blocked; it leaves no failure behind."""

    def __init__(self, name: str, length: float) -> None:
        super().__init__(name)
        self.length = length

    def update(self) -> Status:
        """Look under the outline along the path; a robot that does not know where it is does not know this either."""
        if self.mission.path is None:  # driven to its end in this very tick
            return Status.FAILURE
        path = self.mission.path_to_follow()
        driven = path.length - path.remaining_lengths
        ahead = path[: max(int(np.searchsorted(driven, self.length, side="right")), 1)]
        try:
            answer = self.mission.navigator.server.queries.check_path(ahead, PlaceQuery(), CellState.LETHAL)
        except (TransformError, RobotStateError) as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self.feedback_message = answer.state.name
        return Status.SUCCESS if answer.state > CellState.INSCRIBED else Status.FAILURE


class ClearMap(Leaf):
    """Forget what sensors have marked; always succeeds."""

    def __init__(self, name: str = "clear map") -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Clear the map."""
        self.mission.navigator.server.queries.clear_map()
        return Status.SUCCESS
