"""The ``get_path`` action: from a start and a target pose to a path in the global frame.

Steps of one goal: check names and frames - start pose - map kept alive - plugin under patience and retries - the path
is checked and transformed - result. The robot never moves.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import Action, GoalJob
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.execution.plan_check import area_problem, check_path, in_global_frame
from mbf_abstract.execution.planner import PlannerExecution, PlannerState
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformError
from mbf_abstract.goals.goal_types import GetPathGoal, GetPathResult, NoFeedback
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult, PluginKind
from mbf_abstract.server.plugin_table import PluginTable

Handle = GoalHandle[GetPathGoal, GetPathResult, NoFeedback]
Job = GoalJob[GetPathGoal, GetPathResult, NoFeedback]


class GetPathAction(Action[GetPathGoal, GetPathResult, NoFeedback]):
    """Plans paths."""

    name = "get_path"
    canceled_outcome = GetPathOutcome.CANCELED
    invalid_plugin_outcome = GetPathOutcome.INVALID_PLUGIN
    internal_error_outcome = GetPathOutcome.INTERNAL_ERROR

    def __init__(self, runtime: Runtime, plugins: PluginTable) -> None:
        super().__init__(runtime)
        self._plugins = plugins

    def _check(self, goal: GetPathGoal) -> tuple[int, str] | None:
        """1. Accept only what can be answered: a loaded planner, known frames, sane tolerances."""
        problem = self._plugins.problem(PluginKind.PLANNER, goal.planner)
        if problem:
            return GetPathOutcome.INVALID_PLUGIN, problem
        distance, angle = self._tolerances(goal)
        if not (distance >= 0.0 and angle >= 0.0):  # not a number is no tolerance either
            return GetPathOutcome.INVALID_GOAL, f"tolerances must not be negative, got {distance} m and {angle} rad"
        problem = area_problem(goal.goal_area, self.runtime)
        return (GetPathOutcome.INVALID_GOAL, problem) if problem else None

    def execute(self, job: Job) -> GetPathResult:
        """2. to 5.: from the accepted goal to its result, on the slot's thread."""
        goal, handle = job.handle.goal, job.handle
        plugin = self._plugins.get(PluginKind.PLANNER, goal.planner)
        # 2. Everything the planner sees is in the global frame.
        try:
            request = self._request(goal, handle)
        except (TransformError, RobotStateError) as error:
            return GetPathResult(GetPathOutcome.TF_ERROR, str(error), planner=plugin.name)
        self.runtime.events.emit(
            EventKind.GOAL_STARTED, self.name, goal_id=handle.id, slot=job.slot, plugin=plugin.name
        )
        # 3. Plan, with the map kept alive, under patience and retries.
        run: PluginRun[AbstractPlanner] = PluginRun(
            self.runtime,
            plugin,
            handle,
            patience=lambda: self.runtime.parameters.planner_patience,
            on_abandon=lambda: job.abandon(*self._hung(run.suspect, handle)),
        )
        with run, run.map_in_use():
            execution = PlannerExecution(run, request, goal.goal_area)
            state = execution.execute()
        # 4. Judge how it ended.
        if run.waited_for and not run.canceled:
            return GetPathResult(GetPathOutcome.PAT_EXCEEDED, run.waiting_text(), planner=plugin.name)
        return self._result(state, execution.last_result, handle, request, plugin.name)

    def _request(self, goal: GetPathGoal, handle: Handle) -> PlanRequest:
        def to_global(pose: Pose) -> Pose:
            return in_global_frame(pose, self.runtime)

        relaxed = self.runtime.relaxation.slack(self.runtime.clock.now()).plan_distance
        distance, angle = self._tolerances(goal)
        return PlanRequest(
            start=to_global(goal.start_pose) if goal.start_pose else self.runtime.robot.pose(),
            goal=to_global(goal.target_pose),
            dist_tolerance=max(distance, relaxed),
            angle_tolerance=angle,
            via=tuple(to_global(pose) for pose in goal.via),
            cancel_token=handle.cancel_token,
        )

    def _tolerances(self, goal: GetPathGoal) -> tuple[float, float]:
        """Distance [m] and angle [rad] from the target at which the path may end: the goal's, else the server's."""
        parameters = self.runtime.parameters
        usual = (parameters.dist_tolerance, parameters.angle_tolerance) if goal.goal_area is None else (0.0, 0.0)
        distance = usual[0] if goal.dist_tolerance is None else goal.dist_tolerance
        return distance, usual[1] if goal.angle_tolerance is None else goal.angle_tolerance

    def _result(
        self, state: PlannerState, last: PlanResult | None, handle: Handle, request: PlanRequest, planner: str
    ) -> GetPathResult:
        said = PlanResult(GetPathOutcome.FAILURE, "") if last is None else last
        words: dict[str, Any] = {"planner": planner}
        if last is not None:
            words.update(plugin_outcome=int(said.outcome), plugin_message=said.message)
        if state is PlannerState.FOUND_PLAN:
            return self._found(said, handle, request, words)
        if state is PlannerState.CANCELED:
            return GetPathResult(GetPathOutcome.CANCELED, handle.cancel_reason, **words)
        if state is PlannerState.PAT_EXCEEDED:
            patience = self.runtime.parameters.planner_patience
            tail = f"; the planner said last: {said.message}" if said.message else ""
            return GetPathResult(GetPathOutcome.PAT_EXCEEDED, f"no plan within {patience:g} s{tail}", **words)
        return GetPathResult(int(said.outcome), said.message, cost=said.cost, permanent=said.permanent, **words)

    def _found(self, said: PlanResult, handle: Handle, request: PlanRequest, words: dict[str, Any]) -> GetPathResult:
        """5. Believe a plugin's success only after a look at its path."""
        checked = check_path(said, request, self.runtime, handle.goal.goal_area)
        if checked.path is None:
            return GetPathResult(checked.outcome, checked.message, **words)
        path, cost = checked.path, said.cost if said.cost != 0.0 else checked.path.length
        self.runtime.events.emit(
            EventKind.PLAN,
            self.name,
            goal_id=handle.id,
            plugin=words["planner"],
            cost=cost,
            length=path.length,
            poses=len(path),
        )
        return GetPathResult(int(said.outcome), said.message or "plan found", path=path, cost=cost, **words)

    def _hung(self, suspect: str, handle: Handle) -> tuple[int, str]:
        if handle.cancel_requested:
            return GetPathOutcome.CANCELED, f"{handle.cancel_reason}; {suspect} has not ended yet"
        patience = self.runtime.parameters.planner_patience
        return GetPathOutcome.PAT_EXCEEDED, f"{suspect} gave no answer within {patience:g} s and its grace"

    def make_result(self, handle: Handle, outcome: int, message: str) -> GetPathResult:
        """Result without a path."""
        return GetPathResult(int(outcome), message)

    def _goal_data(self, goal: GetPathGoal) -> dict[str, Any]:
        return {"target": list(goal.target_pose.position), "planner": goal.planner}
