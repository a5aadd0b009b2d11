"""What the nodes of one running tree or state machine share: the navigator, the target, and what came out so far.

There is no global blackboard: an executive makes one ``MissionContext`` for a run and hands it to its nodes, so two
runs never see each other's data and a reader finds every shared value in this file.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbf_abstract.actions.exe_path import ExePathAction
from mbf_abstract.actions.stuck_monitor import StuckMonitor
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import ActionResult, ExePathResult, GetPathResult
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, is_success
from mbf_abstract.time.clock import Clock

PLANNING = ("get_path", "refine_path")
"""Actions that do not hold the robot."""
PATIENCE_CODES = (GetPathOutcome.PAT_EXCEEDED, ExePathOutcome.PAT_EXCEEDED)


@dataclass
class MissionContext:
    """Shared state of one run; nodes read and write it on the executive's thread only.

    Attributes
    ----------
    navigator : Navigator
        Where goals are sent.
    target : Pose, optional
        Where the robot shall go.
    path : Path, optional
        The path to follow. Whoever finds a better one replaces it; the node that drives then follows that one.
    plan, drive : optional
        Last result of ``get_path`` and of ``exe_path``.
    feedback : ExePathFeedback, optional
        Newest feedback of driving along ``path``.
    failure : ActionResult, optional
        The last failure of planning, driving, a check or a watchdog; recoveries are picked by its code.
    refused : float, optional
        When [s] a cycle of driving failed last, also one that was tried again.
    detour_asked : tuple of Pose, float and bool, optional
        Where and when [s] a detour was asked for last, and whether it was taken.
    detour_taken : tuple of Pose and GetPathResult, optional
        Where the last detour was taken, and its plan.
    stuck : StuckMonitor
        The trouble so far: whether the same failure comes again and again at one place.
    """

    navigator: Navigator
    target: Pose | None = None
    path: Path | None = None
    plan: GetPathResult | None = None
    drive: ExePathResult | None = None
    feedback: ExePathFeedback | None = None
    failure: ActionResult | None = None
    refused: float | None = None
    detour_asked: tuple[Pose, float, bool] | None = None
    detour_taken: tuple[Pose, GetPathResult] | None = None
    stuck: StuckMonitor = field(init=False, repr=False)
    _handles: list[AnyGoalHandle] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        server = self.navigator.server
        self.stuck = StuckMonitor(server.runtime, server.plugins)

    @property
    def clock(self) -> Clock:
        """The server's clock."""
        return self.navigator.server.runtime.clock

    @property
    def failure_code(self) -> int:
        """Code of the last failure, 0 without one; where patience ran out, the plugin's own."""
        if self.failure is None:
            return 0
        own = getattr(self.failure, "plugin_outcome", None)
        if self.failure.outcome in PATIENCE_CODES and own is not None and not is_success(own):
            return int(own)
        return self.failure.outcome

    def begin(self, target: Pose) -> None:
        """Forget everything about the old target and go to another one."""
        self.target, self.path, self.plan, self.drive = target, None, None, None
        self.feedback, self.failure, self.refused = None, None, None
        self.detour_asked, self.detour_taken = None, None
        self.stuck.restart()

    def fail(self, failure: ActionResult) -> None:
        """Keep a failure of planning, driving, a check or a watchdog, and count it where the robot is."""
        self.failure = failure
        self.stuck.note_failure(self.failure_code)

    def robot_pose(self) -> Pose:
        """Fresh robot pose in the global frame; raises RobotStateError."""
        return self.navigator.robot_pose()

    def robot_is_slower_than(self, speed: float) -> bool:
        """Whether the robot's speed is known and below ``speed`` [m/s]."""
        try:
            return self.navigator.server.runtime.robot.velocity().speed < speed
        except RobotStateError:
            return False

    def robot_is_near_path(self, distance: float) -> bool:
        """Whether the robot is within ``distance`` [m] of what is left of its path; True where that is not known."""
        with suppress(RobotStateError):
            here = self.robot_pose()
            if self.path is None or self.path.frame_id != here.frame_id:
                return True
            tracker = PathTracker(self.path_to_follow())
            tracker.update((here.x, here.y, here.z))
            return tracker.deviation <= distance
        return True

    def controller_has_refused_within(self, seconds: float) -> bool:
        """Whether a cycle of driving along the mission's path has failed in the last ``seconds``."""
        return self.refused is not None and self.clock.now() - self.refused <= seconds

    def required_target(self) -> Pose:
        """Return the target; raises ValueError where the mission has none."""
        if self.target is None:
            raise ValueError("this node needs a target; give one to the executive's run()")
        return self.target

    # ------------------------------------------------------------------------------------------ goals
    def send(self, goal: Any) -> AnyGoalHandle:
        """Send a goal and remember it, so that no run leaves one behind."""
        handle: AnyGoalHandle = self.navigator.send(goal)
        self._handles = [*self.running_goals(), handle]
        return handle

    def running_goals(self) -> list[AnyGoalHandle]:
        """Goals of this mission that are not final."""
        return [handle for handle in self._handles if not handle.done]

    @property
    def drives(self) -> bool:
        """Whether a goal of this mission follows a path."""
        return any(goal.action == ExePathAction.name for goal in self.running_goals())

    @property
    def robot_is_stopping(self) -> bool:
        """Whether a canceled goal of this mission still holds the robot."""
        return any(goal.cancel_requested and goal.action not in PLANNING for goal in self.running_goals())

    @property
    def paused(self) -> bool:
        """Whether a goal of this mission is paused."""
        return any(goal.paused for goal in self.running_goals())

    def end_goals(self, reason: str) -> None:
        """Cancel all goals of this mission and wait until each of them is final; the robot then stands.

        Places that plans have avoided are open again.
        """
        for handle in self.running_goals():
            handle.cancel(reason)
        for handle in self.running_goals():
            handle.wait()
        self.stuck.finish()

    # ------------------------------------------------------------------------------------------- path
    def path_to_follow(self) -> Path:
        """Return the part of ``path`` the robot has not driven yet; raises ValueError without a path."""
        if self.path is None:
            raise ValueError("this node needs a path; run a node that plans before it")
        if self.feedback is None:
            return self.path
        ahead = self.path.remaining_lengths <= self.feedback.distance_along_path
        first = min(int(np.argmax(ahead)), len(self.path) - 1)
        return self.path[max(first - 1, 0) :]

    def take_plan(self, result: GetPathResult) -> None:
        """Take over the path of a successful plan; the feedback of an older path no longer counts."""
        self.plan, self.path, self.feedback = result, result.path, None
