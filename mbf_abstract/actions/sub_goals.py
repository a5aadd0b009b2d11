"""The goals that ``move_base`` sends to the other actions, and the mailbox for their ends and their feedback."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from mbf_abstract.actions.action import Action, GoalJob
from mbf_abstract.actions.exe_path import ExePathAction
from mbf_abstract.actions.get_path import GetPathAction
from mbf_abstract.actions.recovery import RecoveryAction
from mbf_abstract.actions.refine_path import RefinePathAction
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.feedback_types import MoveBaseFeedback
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import MoveBaseResult

SUB_GOAL_SLOT = 255  # so that a client's goal in slot 0 does not preempt a part of move_base

Job = GoalJob[MoveBaseGoal, MoveBaseResult, MoveBaseFeedback]


class SubActions(NamedTuple):
    """The actions that ``move_base`` sends goals to."""

    get_path: GetPathAction
    exe_path: ExePathAction
    recovery: RecoveryAction
    refine_path: RefinePathAction


class SubGoals:
    """The present goals of one run of ``move_base``.

    Attributes
    ----------
    plan, follow, recover : GoalHandle or None
        The goal that plans, or refines the plan; the one that follows a path; the one that recovers.
    area : GoalArea or None
        Where the goal of the job ends, in the global frame.
    """

    def __init__(self, actions: SubActions, job: Job, area: GoalArea | None = None) -> None:
        self.plan: AnyGoalHandle | None = None
        self.follow: AnyGoalHandle | None = None
        self.recover: AnyGoalHandle | None = None
        self.area = area
        self._actions = actions
        self._job = job
        self._condition = job.action.runtime.clock.condition()
        self._mailbox: deque[AnyGoalHandle] = deque()

    # ---------------------------------------------------------------------------------------------------- sending
    def send_plan(self, target: Pose, via: tuple[Pose, ...], dist_tolerance: float | None) -> None:
        """Ask for a plan of the job's goal, which may end so far [m] from the target; None = as ``get_path`` has it."""
        goal = self._job.handle.goal
        self.plan = self._send(
            self._actions.get_path,
            GetPathGoal(
                target,
                planner=goal.planner,
                dist_tolerance=dist_tolerance,
                angle_tolerance=goal.angle_tolerance,
                goal_area=self.area,
                via=via,
                concurrency_slot=SUB_GOAL_SLOT,
            ),
        )

    def send_refinement(self, path: Path, refiner: str) -> None:
        """Have a plan refined; this counts as planning."""
        self.plan = self._send(self._actions.refine_path, RefinePathGoal(path, refiner, concurrency_slot=SUB_GOAL_SLOT))

    def send_path(self, path: Path, dist_tolerance: float | None) -> None:
        """Have a path followed, to within a tolerance [m]; it takes over the present one."""
        goal = self._job.handle.goal
        self.follow = self._send(
            self._actions.exe_path,
            ExePathGoal(
                path,
                controller=goal.controller,
                dist_tolerance=dist_tolerance,
                angle_tolerance=goal.angle_tolerance,
                goal_area=self.area,
                concurrency_slot=SUB_GOAL_SLOT,
            ),
        )

    def send_recovery(self, behavior: str) -> None:
        """Have a recovery behaviour run."""
        self.recover = self._send(self._actions.recovery, RecoveryGoal(behavior, concurrency_slot=SUB_GOAL_SLOT))

    def _send(self, action: Action[Any, Any, Any], goal: object) -> AnyGoalHandle:
        handle: AnyGoalHandle = action.send(goal)
        if self._job.handle.paused:
            handle.pause()
        handle.on_wake(self.wake)
        handle.subscribe(self._post)
        return handle

    # ------------------------------------------------------------------------------------- what happens to all of them
    @property
    def unfinished(self) -> list[AnyGoalHandle]:
        """Those that are not final."""
        return [one for one in (self.plan, self.follow, self.recover) if one is not None and not one.done]

    def cancel(self, reason: str) -> None:
        """Cancel the unfinished ones; never waits."""
        for handle in self.unfinished:
            handle.cancel(reason)

    def cancel_plan(self, reason: str) -> None:
        """Cancel the goal that plans, whose end then counts no more."""
        if self.plan is not None:
            self.plan.cancel(reason)
            self.plan = None

    def set_paused(self, paused: bool) -> None:
        """Pause the unfinished ones, or let them go on."""
        for handle in self.unfinished:
            handle.pause() if paused else handle.resume()

    # -------------------------------------------------------------------------------------------------- the mailbox
    def wake(self) -> None:
        """End the wait of ``next_message``."""
        with self._condition:
            self._condition.notify_all()

    def next_message(self, has_news: Callable[[], bool], timeout: Callable[[], float | None]) -> AnyGoalHandle | None:
        """Return the next goal that has ended or has feedback; None after ``wake``, news or the timeout [s]."""
        with self._condition:
            if not self._mailbox and not has_news():
                self._condition.wait(timeout())
            return self._mailbox.popleft() if self._mailbox else None

    def _post(self, handle: AnyGoalHandle) -> None:
        with self._condition:
            self._mailbox.append(handle)
            self._condition.notify_all()
