"""The ``exe_path`` action: follow a path with a controller until the robot stands at its end.

Steps of one goal: check - (a goal for the same slot and controller: hand the path to the running loop, the robot does
not stop) - path into the global frame - control loop - result. See ``execution.controller`` for one cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mbf_abstract.actions.action import PREEMPTED, Action, GoalJob
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.arrival import ArrivalCheck, ToleranceCheck
from mbf_abstract.execution.controller import ControllerExecution
from mbf_abstract.execution.controller_state import ControllerEnd, Cycle, Plan
from mbf_abstract.execution.loaded_plugin import LoadedPlugin
from mbf_abstract.execution.plan_check import area_problem, path_in_global_frame
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.execution.progress import PathProgress
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.goals.goal_types import ExePathFeedback, ExePathGoal, ExePathResult
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import AbstractController, PluginKind
from mbf_abstract.server.plugin_table import PluginTable

Handle = GoalHandle[ExePathGoal, ExePathResult, ExePathFeedback]
Job = GoalJob[ExePathGoal, ExePathResult, ExePathFeedback]


@dataclass
class Following:
    """A running control loop; a newer goal for its slot and controller may be offered to it."""

    job: Job
    controller: str
    offered: Job | None = None
    over: bool = False
    execution: ControllerExecution | None = None


class ExePathAction(Action[ExePathGoal, ExePathResult, ExePathFeedback]):
    """Follows paths."""

    name = "exe_path"
    canceled_outcome = ExePathOutcome.CANCELED
    invalid_plugin_outcome = ExePathOutcome.INVALID_PLUGIN
    internal_error_outcome = ExePathOutcome.INTERNAL_ERROR

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        super().__init__(runtime)
        self._plugins = plugins
        self._following: dict[int, Following] = {}

    def _check(self, goal: ExePathGoal) -> tuple[int, str] | None:
        """1. Accept only a loaded controller, a path with poses, and frames that are known."""
        problem = self._plugins.problem(PluginKind.CONTROLLER, goal.controller)
        if problem:
            return ExePathOutcome.INVALID_PLUGIN, problem
        if len(goal.path) == 0:
            return ExePathOutcome.INVALID_PATH, "the path has no poses"
        for name in ("dist_tolerance", "angle_tolerance"):
            value = getattr(goal, name)
            if value is not None and not value > 0.0:
                return ExePathOutcome.INVALID_PATH, f"{name} must be positive, got {value}"
        problem = area_problem(goal.goal_area, self.runtime)
        return (ExePathOutcome.INVALID_PATH, problem) if problem else None

    # ----------------------------------------------------------------------- 2. plan update while driving
    def _dispatch(self, job: Job) -> None:
        """Offer the goal to a loop that runs the same controller in this slot, else queue it."""
        with self._condition:
            following = self._following.get(job.slot)
            accepted = following is not None and self._can_take_over(following, job.handle.goal.controller)
            displaced = None
            if following is not None and accepted:
                displaced, following.offered = following.offered, job
        if not accepted:
            super()._dispatch(job)
        elif displaced is not None:
            self.finish(displaced.handle, self.canceled_outcome, f"{PREEMPTED} before it started")

    @staticmethod
    def _can_take_over(following: Following, controller: str) -> bool:
        return (
            not following.over
            and not following.job.handle.cancel_requested
            and controller in ("", following.controller)
        )

    def _take_offer(self, following: Following, run: PluginRun[AbstractController]) -> ExePathGoal | None:
        """Let the loop serve the offered goal; the old goal ends CANCELED, the robot drives on."""
        with self._condition:
            offer, following.offered = following.offered, None
        if offer is None:
            return None
        old, following.job.handle = following.job.handle, offer.handle
        offer.handle.activate()
        run.adopt(offer.handle)
        self.finish(old, self.canceled_outcome, "preempted by a new plan")
        self._report_started(following)
        return offer.handle.goal

    def _end_following(self, following: Following) -> None:
        """Queue an offer that came too late for the loop: it must not be lost."""
        with self._condition:
            following.over = True
            if self._following.get(following.job.slot) is following:
                del self._following[following.job.slot]
            late, following.offered = following.offered, None
        if late is not None:
            super()._dispatch(late)

    # ------------------------------------------------------------------------------------- 3. following
    def execute(self, job: Job) -> ExePathResult:
        """Run the control loop; the goal it ends with may be a later one than it began with."""
        plugin = self._plugins.get(PluginKind.CONTROLLER, job.handle.goal.controller)
        try:
            plan = self._plan(job.handle.goal)
        except TransformError as error:
            return self.make_result(job.handle, ExePathOutcome.TF_ERROR, str(error))
        following = Following(job, plugin.name)
        with self._condition:
            self._following[job.slot] = following
        try:
            return self._follow(following, plugin, plan)
        finally:
            self._end_following(following)

    def _follow(
        self, following: Following, plugin: LoadedPlugin[AbstractController], first_plan: Plan
    ) -> ExePathResult:
        progress = PathProgress(self.runtime.clock, first_plan.tracker)
        plans = [first_plan]

        def take_new_plan() -> Plan | None:
            goal = None if plans else self._take_offer(following, run)
            if goal is not None:
                plans.append(self._plan(goal))
                progress.restart(plans[0].tracker)
            return plans.pop() if plans else None

        def publish(cycle: Cycle) -> None:
            following.job.handle.publish_feedback(progress.feedback(cycle.pose, cycle.result))

        run: PluginRun[AbstractController] = PluginRun(
            self.runtime,
            plugin,
            following.job.handle,
            patience=lambda: self.runtime.parameters.controller_patience,
            on_abandon=lambda: self._abandon(following, run),
        )
        self._report_started(following)
        with run, run.map_in_use():
            following.execution = ControllerExecution(run, take_new_plan, publish)
            end = following.execution.execute()
        return self._result(end, following.execution, progress.path, plugin.name)

    def _plan(self, goal: ExePathGoal) -> Plan:
        parameters = self.runtime.parameters
        path = path_in_global_frame(goal.path, self.runtime)
        arrival = ArrivalCheck(
            path[-1],
            parameters.dist_tolerance if goal.dist_tolerance is None else goal.dist_tolerance,
            parameters.angle_tolerance if goal.angle_tolerance is None else goal.angle_tolerance,
            self._tolerance_check(),
            goal.goal_area,
        )
        return Plan(path, arrival)

    def _tolerance_check(self) -> ToleranceCheck:
        parameters = self.runtime.parameters
        if parameters.mbf_tolerance_exclusive:
            return "exclusive"
        return "either" if parameters.mbf_tolerance_check else "plugin"

    def _abandon(self, following: Following, run: PluginRun[AbstractController]) -> None:
        """A call of the controller, the driver or the map hangs: stop the robot, end the goal, free the slot."""
        if following.execution is not None:
            following.execution.stop_robot(f"{run.suspect} hangs")
        handle = following.job.handle
        self._end_following(following)
        if handle.cancel_requested:
            text = f"{handle.cancel_reason}; {run.suspect} has not ended yet"
            following.job.abandon(ExePathOutcome.CANCELED, text)
        else:
            patience = self.runtime.parameters.controller_patience
            text = f"{run.suspect} gave no answer within {patience:g} s and its grace"
            following.job.abandon(ExePathOutcome.PAT_EXCEEDED, text)

    # ---------------------------------------------------------------------------------------- 4. results
    def _result(self, end: ControllerEnd, execution: ControllerExecution, path: Path, controller: str) -> ExePathResult:
        pose, last = self._robot_pose(), execution.last_result
        return ExePathResult(
            end.outcome,
            end.message,
            final_pose=pose,
            dist_to_goal=pose.distance_to(path[-1]) if pose else float("inf"),
            angle_to_goal=pose.angle_to(path[-1]) if pose else float("inf"),
            controller=controller,
            plugin_outcome=None if last is None else int(last.outcome),
            plugin_message="" if last is None else last.message,
        )

    def make_result(self, handle: Handle, outcome: int, message: str) -> ExePathResult:
        """Result of a goal that ended before or without its control loop."""
        pose = self._robot_pose()
        return ExePathResult(int(outcome), message, final_pose=pose, controller=handle.goal.controller)

    def _robot_pose(self) -> Pose | None:
        try:
            return self.runtime.robot.pose()
        except RobotStateError:
            return None

    def _report_started(self, following: Following) -> None:
        job = following.job
        self.runtime.events.emit(
            EventKind.GOAL_STARTED, self.name, goal_id=job.handle.id, slot=job.slot, plugin=following.controller
        )

    def _goal_data(self, goal: ExePathGoal) -> dict[str, Any]:
        return {"controller": goal.controller, "poses": len(goal.path), "length": goal.path.length}
