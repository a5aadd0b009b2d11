"""The ``follow_waypoints`` action: a sequence of waypoints, each reached with a ``move_base`` goal of its own.

Steps of one visit: wait while paused - send the goal - pass cancel and pause on to it - run the task, while
the robot stands there - next. A visit that another client cancels, or replaces by another goal, ends the sequence
as CANCELED; one that is rejected ends it regardless of ``stop_on_failure``.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import Action, GoalJob
from mbf_abstract.actions.move_base import MoveBaseAction
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.plugin_run import IDLE_CHECK, Abandoned
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.feedback_types import ExePathFeedback, FollowWaypointsFeedback, MoveBaseFeedback
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import FollowWaypointsGoal, MoveBaseGoal, WaypointTask
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import FollowWaypointsResult, MoveBaseResult
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.time.clock import TIME_RESOLUTION, ThreadDetached

Handle = GoalHandle[FollowWaypointsGoal, FollowWaypointsResult, FollowWaypointsFeedback]
Job = GoalJob[FollowWaypointsGoal, FollowWaypointsResult, FollowWaypointsFeedback]
Drive = GoalHandle[MoveBaseGoal, MoveBaseResult, MoveBaseFeedback]


class FollowWaypointsAction(Action[FollowWaypointsGoal, FollowWaypointsResult, FollowWaypointsFeedback]):
    """Drives waypoint sequences; one at a time, a new one ends the old one."""

    name = "follow_waypoints"
    canceled_outcome = MoveBaseOutcome.CANCELED
    invalid_plugin_outcome = MoveBaseOutcome.FAILURE
    internal_error_outcome = MoveBaseOutcome.INTERNAL_ERROR

    def __init__(self, runtime: Runtime, move_base: MoveBaseAction) -> None:
        super().__init__(runtime)
        self.move_base = move_base

    def _check(self, goal: FollowWaypointsGoal) -> tuple[int, str] | None:
        """Accept only visits that move_base would accept."""
        return self.move_base.rejection(goal.visit(0)) if goal.waypoints else None

    def execute(self, job: Job) -> FollowWaypointsResult:
        """Visit one waypoint after the other, on the slot's thread."""
        job.report_started()
        return _Run(self, job).run()

    def make_result(self, handle: Handle, outcome: int, message: str) -> FollowWaypointsResult:
        """Result with the visits that have ended."""
        done = handle.feedback.results if handle.feedback is not None else ()
        return FollowWaypointsResult(int(outcome), message, results=done)

    def _goal_data(self, goal: FollowWaypointsGoal) -> dict[str, Any]:
        return {"waypoints": len(goal.waypoints), "loops": goal.loops}


class _Run:
    """One goal's visits."""

    def __init__(self, action: FollowWaypointsAction, job: Job) -> None:
        self._action = action
        self._runtime = action.runtime
        self._job = job
        self._handle = job.handle
        self._goal = job.handle.goal
        self._results: tuple[MoveBaseResult, ...] = ()
        self._condition = self._runtime.clock.condition()

    def run(self) -> FollowWaypointsResult:
        """Make all visits, or as many as the goal allows."""
        self._handle.on_wake(self._wake)
        for visit in range(self._goal.visits):
            self._wait_while_paused()
            if self._handle.cancel_requested:
                return self._end(MoveBaseOutcome.CANCELED, self._handle.cancel_reason)
            drive = self._make_visit(visit)
            if drive.status is GoalStatus.CANCELED or self._handle.cancel_requested:
                reason = self._handle.cancel_reason or f"visit {visit} was canceled: {self._results[-1].message}"
                return self._end(MoveBaseOutcome.CANCELED, reason)
            problem = self._do_task(visit) if self._results[-1].success else ""
            if problem:
                return self._end(MoveBaseOutcome.INTERNAL_ERROR, problem)
            may_go_on = drive.status is not GoalStatus.REJECTED and not self._goal.stop_on_failure
            if not (self._results[-1].success or may_go_on):
                break
        return self._judged()

    def _make_visit(self, visit: int) -> Drive:
        """Drive to one waypoint; the drive is paused and canceled as the sequence is."""
        drive = self._action.move_base.send(self._goal.visit(visit))
        drive.on_wake(self._wake)
        drive.subscribe(lambda drive: self._on_drive(visit, drive))
        while not drive.done:
            if self._handle.cancel_requested:
                drive.cancel(self._handle.cancel_reason)
            drive.pause() if self._handle.paused else drive.resume()
            with self._condition:
                if not drive.done and not self._is_ahead_of(drive):
                    self._condition.wait()
        assert drive.result is not None
        self._results = (*self._results, drive.result)
        self._publish(visit, None)
        return drive

    def _is_ahead_of(self, drive: Drive) -> bool:
        """Whether a cancel or pause of the sequence has not reached the drive yet."""
        canceled = self._handle.cancel_requested and not drive.cancel_requested
        return canceled or self._handle.paused != drive.paused

    def _on_drive(self, visit: int, drive: Drive) -> None:
        if drive.done:
            self._wake()
        else:
            self._publish(visit, drive.feedback)

    def _publish(self, visit: int, driving: ExePathFeedback | None) -> None:
        waypoint = visit % len(self._goal.waypoints)
        self._handle.publish_feedback(FollowWaypointsFeedback(visit, waypoint, self._results, driving))

    def _wait_while_paused(self) -> None:
        with self._condition:
            while self._handle.paused and not self._handle.cancel_requested:
                self._condition.wait()

    def _wake(self) -> None:
        with self._condition:
            self._condition.notify_all()

    def _do_task(self, visit: int) -> str:
        """Run the user's task, if there is one; return what went wrong."""
        waypoint = visit % len(self._goal.waypoints)
        task = self._goal.task
        return "" if task is None else _TaskRun(self._job, task, waypoint).run(self._goal.waypoints[waypoint])

    # ------------------------------------------------------------------------------------------------ ends
    def _judged(self) -> FollowWaypointsResult:
        failed = [visit for visit, result in enumerate(self._results) if not result.success]
        if not failed:
            return self._end(MoveBaseOutcome.SUCCESS, f"{len(self._results)} visit(s) made")
        first = self._results[failed[0]]
        text = f"{len(failed)} of {self._goal.visits} visit(s) failed, first visit {failed[0]}: {first.message}"
        left_out = self._goal.visits - len(self._results)
        return self._end(first.outcome, f"{text}; {left_out} visit(s) left out" if left_out else text)

    def _end(self, outcome: int, message: str) -> FollowWaypointsResult:
        return FollowWaypointsResult(int(outcome), message, results=self._results)


class _TaskRun:
    """One run of the user's task; a cancel waits for it no longer than the grace, and the hang guard watches it."""

    def __init__(self, job: Job, task: WaypointTask, waypoint: int) -> None:
        self._job = job
        self._runtime = job.action.runtime
        self._task = task
        self._waypoint = waypoint
        self._canceled_at: float | None = None
        self._condition = self._runtime.clock.condition()
        self._over = False
        self._abandoned = False
        self._hung = False

    def run(self, pose: Pose) -> str:
        """Call the task and return what went wrong; raises Abandoned if the sequence has ended meanwhile."""
        supervisor, problem = self._runtime.supervisor, ""
        self._watch = watch = supervisor.watch(self._check, 0.0)
        self._job.handle.on_wake(lambda: supervisor.poke(watch))
        try:
            with self._runtime.clock.guarded(f"the task at waypoint {self._waypoint}", self._declare_hung):
                self._task(self._waypoint, pose)
        except ThreadDetached:
            self._abandon()  # the supervisor may not have seen it yet
        except BaseException as error:
            problem = f"the task at waypoint {self._waypoint} raised {type(error).__name__}: {error_text(error)}"
            name, goal_id = self._job.action.name, self._job.handle.id
            self._runtime.events.emit(EventKind.FAULT, name, goal_id=goal_id, message=problem)
        with self._condition:
            self._over = True  # from now on it cannot be abandoned
        supervisor.stop(watch)
        if self._abandoned:
            self._runtime.hanging.discard(self)
            raise Abandoned(self._job.action.name)
        return problem

    def _check(self) -> float | None:
        """Supervisor: give up on the task when the grace after a cancel is over."""
        handle, now = self._job.handle, self._runtime.clock.now()
        if self._hung:
            return self._abandon()
        if not handle.cancel_requested:
            return IDLE_CHECK
        if self._canceled_at is None:
            self._canceled_at = now
        grace_left = self._canceled_at + self._runtime.parameters.cancel_grace - now
        return grace_left if grace_left > TIME_RESOLUTION else self._abandon()

    def _declare_hung(self) -> None:
        """Give up at once: the task has stopped simulated time for too long, and its thread was detached."""
        self._hung = True
        self._runtime.supervisor.poke(self._watch)

    def _abandon(self) -> float | None:
        """End the sequence without the task's thread, once; the answer to the supervisor."""
        with self._condition:
            if self._over or self._abandoned:
                return None
            self._abandoned = True
            self._runtime.hanging.add(self)
        if self._job.handle.cancel_requested:
            text = f"{self._job.handle.cancel_reason}; the task at waypoint {self._waypoint} has not ended yet"
            self._job.abandon(MoveBaseOutcome.CANCELED, text)
        else:
            text = f"the task at waypoint {self._waypoint} stopped the clock for too long (hang_guard)"
            self._job.abandon(MoveBaseOutcome.INTERNAL_ERROR, text)
        return None
