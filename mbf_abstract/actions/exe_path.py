"""The ``exe_path`` action: follow a path with a controller until the robot stands at its end.

Steps of one goal: check - path into the global frame - control loop - result. A goal for the same slot and controller
is taken over by the running loop, and the robot does not stop. See ``execution.controller`` for one cycle.
"""

from __future__ import annotations

import math
from typing import Any

from mbf_abstract.actions.action import GoalJob
from mbf_abstract.actions.plugin_action import PluginAction
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.execution.arrival import ArrivalCheck, ToleranceCheck
from mbf_abstract.execution.controller import ControllerExecution
from mbf_abstract.execution.controller_state import ControllerEnd, Plan
from mbf_abstract.execution.plan_check import area_in_global_frame, path_in_global_frame, tolerance_problem
from mbf_abstract.execution.progress import PathProgress
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.tangent_plane import SAME_STOREY
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import ExePathResult
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import AbstractController, ControlResult, PluginKind

Handle = GoalHandle[ExePathGoal, ExePathResult, ExePathFeedback]
Job = GoalJob[ExePathGoal, ExePathResult, ExePathFeedback]


class ExePathAction(PluginAction[ExePathGoal, ExePathResult, ExePathFeedback, AbstractController]):
    """Follows paths."""

    name = "exe_path"
    kind = PluginKind.CONTROLLER
    canceled_outcome = ExePathOutcome.CANCELED
    patience_outcome = ExePathOutcome.PAT_EXCEEDED
    invalid_plugin_outcome = ExePathOutcome.INVALID_PLUGIN
    internal_error_outcome = ExePathOutcome.INTERNAL_ERROR

    @property
    def patience(self) -> float:
        """Time [s] without a valid command."""
        return self.runtime.parameters.controller_patience

    def _plugin_name(self, goal: ExePathGoal) -> str:
        return goal.controller

    def _problem(self, goal: ExePathGoal) -> tuple[int, str] | None:
        """1. Accept only a path with poses and positive tolerances."""
        problem = "the path has no poses" if len(goal.path) == 0 else tolerance_problem(goal)
        return (ExePathOutcome.INVALID_PATH, problem) if problem else None

    def execute(self, job: Job) -> ExePathResult:
        """Run the control loop; the goal it ends with may be a later one than it began with."""
        plugin = self._plugin(job)
        # 2. The path, and the area to end in, in the global frame.
        try:
            first_plan = self._plan(job.handle.goal)
        except TransformError as error:
            return self.make_result(job.handle, ExePathOutcome.TF_ERROR, str(error))
        # 3. Follow it. A new goal for the same controller brings a new path; the robot drives on.
        progress = PathProgress(self.runtime.clock, first_plan.tracker)
        plans = [first_plan]

        def take_new_plan() -> Plan | None:
            if not plans and job.take_over(run.adopt, "preempted by a new plan", plugin=plugin.name):
                plans.append(self._plan(job.handle.goal))
                progress.restart(plans[0].tracker)
            return plans.pop() if plans else None

        def publish(pose: Pose, result: ControlResult) -> None:
            job.handle.publish_feedback(progress.feedback(pose, result))

        run = self._supervise(job, plugin, lambda reason: execution.stop_robot(reason))
        execution = ControllerExecution(run, take_new_plan, publish)
        with job.open_to_take_over(lambda goal: goal.controller in ("", plugin.name)):
            job.report_started(plugin=plugin.name)
            with run, run.map_in_use():
                end = execution.execute()
            # 4. Where the robot is now.
            return self._result(end, execution, progress.path, plugin.name)

    def _plan(self, goal: ExePathGoal) -> Plan:
        parameters = self.runtime.parameters
        path = path_in_global_frame(goal.path, self.runtime)
        arrival = ArrivalCheck(
            path[-1],
            parameters.dist_tolerance if goal.dist_tolerance is None else goal.dist_tolerance,
            parameters.angle_tolerance if goal.angle_tolerance is None else goal.angle_tolerance,
            self._tolerance_check(),
            area_in_global_frame(goal.goal_area, self.runtime),
            math.inf if self.runtime.map_hooks.ground_is_level else SAME_STOREY,
        )
        return Plan(path, arrival)

    def _tolerance_check(self) -> ToleranceCheck:
        parameters = self.runtime.parameters
        if parameters.mbf_tolerance_exclusive:
            return "exclusive"
        return "either" if parameters.mbf_tolerance_check else "plugin"

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

    def _goal_data(self, goal: ExePathGoal) -> dict[str, Any]:
        return {"controller": goal.controller, "poses": len(goal.path), "length": goal.path.length}
