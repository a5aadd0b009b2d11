"""Questions a tree can ask without moving the robot, and what to do with the path: answered within one tick."""

from __future__ import annotations

import math
from collections.abc import Callable

from py_trees.common import Status

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.executives.nodes import Leaf
from mbf_abstract.geometry import Path, Pose, quaternion_from_yaw
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, is_success
from mbf_abstract.time.clock import TIME_RESOLUTION, Stopwatch

BEYOND_RECOVERY = frozenset(
    [
        GetPathOutcome.CANCELED,
        GetPathOutcome.INVALID_START,
        GetPathOutcome.INVALID_GOAL,
        GetPathOutcome.TF_ERROR,
        GetPathOutcome.NOT_INITIALIZED,
        GetPathOutcome.INVALID_PLUGIN,
        GetPathOutcome.INTERNAL_ERROR,
        GetPathOutcome.OUT_OF_MAP,
        ExePathOutcome.CANCELED,
        ExePathOutcome.INVALID_PATH,
        ExePathOutcome.TF_ERROR,
        ExePathOutcome.NOT_INITIALIZED,
        ExePathOutcome.INVALID_PLUGIN,
        ExePathOutcome.INTERNAL_ERROR,
        ExePathOutcome.OUT_OF_MAP,
    ]
)
"""Failures that clearing a map or moving the robot cannot resolve."""


def recovery_would_help(outcome: int) -> bool:
    """Whether a recovery behaviour may help after this outcome of planning or driving."""
    return not is_success(outcome) and outcome not in BEYOND_RECOVERY


class Do(Leaf):
    """Call a short function of the mission; succeed if it returns True. For a step or a question of your own."""

    def __init__(self, name: str, function: Callable[[MissionContext], bool]) -> None:
        super().__init__(name)
        self.function = function

    def update(self) -> Status:
        """Call it."""
        return Status.SUCCESS if self.function(self.mission) else Status.FAILURE


class WouldRecoveryHelp(Leaf):
    """Succeed if a recovery may help after the mission's last failure."""

    def __init__(self, name: str = "would a recovery help?") -> None:
        super().__init__(name)

    def update(self) -> Status:
        """Judge the code of the last failure."""
        code = self.mission.failure_code
        self.feedback_message = f"code {code}"
        return Status.SUCCESS if recovery_would_help(code) else Status.FAILURE


class GoalReached(Leaf):
    """Succeed if the robot is within ``distance`` [m] of the mission's target; fails where its pose is unknown."""

    def __init__(self, name: str = "goal reached?", distance: float = 0.25) -> None:
        super().__init__(name)
        self.distance = distance

    def update(self) -> Status:
        """Measure the straight distance."""
        try:
            distance = self.mission.robot_pose().distance_to(self.mission.required_target())
        except RobotStateError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        self.feedback_message = f"{distance:.2f} m"
        return Status.SUCCESS if distance < self.distance else Status.FAILURE


class TimePassed(Leaf):
    """Succeed once every ``seconds``, fail in between; the time starts at the first tick."""

    def __init__(self, name: str, seconds: float) -> None:
        super().__init__(name)
        self.seconds = seconds
        self._watch: Stopwatch | None = None

    def update(self) -> Status:
        """Look at the clock."""
        if self._watch is None:
            self._watch = Stopwatch(self.mission.clock)
        if self._watch.elapsed < self.seconds - TIME_RESOLUTION:
            return Status.FAILURE
        self._watch.restart()
        return Status.SUCCESS


def truncated(path: Path, distance: float) -> Path:
    """Cut a path off so that it ends at least ``distance`` [m] before its last pose, looking there.

    At least two poses are kept; a path that is shorter than that comes back as it is.
    """
    goal = path[-1]
    last = len(path) - 1
    while last > 1 and path[last].distance_to(goal) < distance:
        last -= 1
    if last == len(path) - 1:
        return path
    end = path[last]
    yaw = math.atan2(goal.y - end.y, goal.x - end.x)
    facing = Pose(end.position, quaternion_from_yaw(yaw), path.frame_id)
    return Path.from_poses([*path[:last], facing], path.stamp)


class TruncatePath(Leaf):
    """Shorten the mission's path to end ``distance`` [m] earlier, e.g. in front of a person; fails without a path."""

    def __init__(self, name: str, distance: float) -> None:
        super().__init__(name)
        self.distance = distance

    def update(self) -> Status:
        """Replace the mission's path."""
        if self.mission.path is None:
            return Status.FAILURE
        self.mission.path = truncated(self.mission.path, self.distance)
        return Status.SUCCESS
