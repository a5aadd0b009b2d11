"""What most scripts import: one object for everything a robot can be asked to do.

Every call comes in three forms. ``navigator.get_path(...)`` blocks and returns the result; ``navigator.send(goal)``
returns a handle at once; ``await navigator.send(goal)`` suits asyncio. The same script runs on every map: which
backend serves it is one line of the configuration.

Example
-------
>>> with Navigator.from_file("robot.yaml", robot, clock) as navigator:
...     plan = navigator.get_path(Pose.planar(8.0, 3.0))
...     if plan.success:
...         navigator.exe_path(plan.path)
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, overload

from mbf_abstract.drive.robot import Robot
from mbf_abstract.event_bus import EventBus
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.feedback_types import ExePathFeedback, FollowWaypointsFeedback, MoveBaseFeedback, NoFeedback
from mbf_abstract.goals.goal_types import (
    ExePathGoal,
    FollowWaypointsGoal,
    GetPathGoal,
    MoveBaseGoal,
    RecoveryGoal,
    RefinePathGoal,
    WaypointTask,
)
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import (
    ExePathResult,
    FollowWaypointsResult,
    GetPathResult,
    MoveBaseResult,
    RecoveryResultMessage,
    RefinePathResult,
)
from mbf_abstract.server.factory import make_server
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock, WallClock


class Navigator:
    """Blocking calls and handles on top of a server's actions."""

    def __init__(self, server: AbstractNavigationServer) -> None:
        self.server = server

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        robot: Robot,
        clock: Clock | None = None,
        transforms: TransformBuffer | None = None,
        events: EventBus | None = None,
        seed: int = 0,
    ) -> Navigator:
        """Make the server a configuration file asks for; raises ConfigError with all findings."""
        return cls(make_server(path, robot, clock or WallClock(), transforms, events, seed))

    @overload
    def send(self, goal: GetPathGoal) -> GoalHandle[GetPathGoal, GetPathResult, NoFeedback]: ...
    @overload
    def send(self, goal: ExePathGoal) -> GoalHandle[ExePathGoal, ExePathResult, ExePathFeedback]: ...
    @overload
    def send(self, goal: RecoveryGoal) -> GoalHandle[RecoveryGoal, RecoveryResultMessage, NoFeedback]: ...
    @overload
    def send(self, goal: RefinePathGoal) -> GoalHandle[RefinePathGoal, RefinePathResult, NoFeedback]: ...
    @overload
    def send(self, goal: MoveBaseGoal) -> GoalHandle[MoveBaseGoal, MoveBaseResult, MoveBaseFeedback]: ...
    @overload
    def send(
        self, goal: FollowWaypointsGoal
    ) -> GoalHandle[FollowWaypointsGoal, FollowWaypointsResult, FollowWaypointsFeedback]: ...
    def send(self, goal: Any) -> Any:
        """Send any goal to its action and return the handle at once."""
        server = self.server
        actions = {
            GetPathGoal: server.get_path,
            ExePathGoal: server.exe_path,
            RecoveryGoal: server.recovery,
            RefinePathGoal: server.refine_path,
            MoveBaseGoal: server.move_base,
            FollowWaypointsGoal: server.follow_waypoints,
        }
        action: Any = actions.get(type(goal))
        if action is None:
            raise TypeError(f"expected one of {', '.join(t.__name__ for t in actions)}, got {type(goal).__name__}")
        return action.send(goal)

    def get_path(self, target_pose: Pose, **fields: Any) -> GetPathResult:
        """Plan to a pose and wait; ``fields`` are those of ``GetPathGoal``."""
        return self.send(GetPathGoal(target_pose, **fields)).wait()

    def exe_path(self, path: Path, **fields: Any) -> ExePathResult:
        """Follow a path and wait; ``fields`` are those of ``ExePathGoal``."""
        return self.send(ExePathGoal(path, **fields)).wait()

    def recover(self, behavior: str = "", **fields: Any) -> RecoveryResultMessage:
        """Run a recovery behaviour and wait; ``fields`` are those of ``RecoveryGoal``."""
        return self.send(RecoveryGoal(behavior, **fields)).wait()

    def refine_path(self, path: Path, **fields: Any) -> RefinePathResult:
        """Refine a path and wait; ``fields`` are those of ``RefinePathGoal``."""
        return self.send(RefinePathGoal(path, **fields)).wait()

    def go_to(self, target_pose: Pose, **fields: Any) -> MoveBaseResult:
        """Run ``move_base`` to a pose and wait; ``fields`` are those of ``MoveBaseGoal``."""
        return self.send(MoveBaseGoal(target_pose, **fields)).wait()

    def follow_waypoints(
        self,
        waypoints: Iterable[Pose],
        *,
        loops: int = 1,
        stop_on_failure: bool = True,
        task: WaypointTask | None = None,
        **fields: Any,
    ) -> FollowWaypointsResult:
        """Visit poses in order with ``move_base`` and wait; all arguments are fields of ``FollowWaypointsGoal``."""
        return self.send(FollowWaypointsGoal(tuple(waypoints), loops, stop_on_failure, task, **fields)).wait()

    def robot_pose(self) -> Pose:
        """Fresh robot pose in the global frame; raises RobotStateError."""
        return self.server.runtime.robot.pose()

    def ground_pose(self, x: float, y: float, yaw: float = 0.0) -> Pose:
        """Pose on the ground at (x, y) [m], looking along ``yaw`` [rad]: on the lowest free storey there."""
        return self.server.ground_pose(x, y, yaw)

    def cancel_all(self) -> None:
        """Cancel every running goal."""
        self.server.cancel_all()

    def close(self) -> None:
        """Stop the robot and shut the server down."""
        self.server.close()

    def __enter__(self) -> Navigator:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
