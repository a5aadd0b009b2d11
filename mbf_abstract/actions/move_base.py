"""The ``move_base`` action: go to a pose by planning, following and recovering, as one explicit state machine.

It is a client of the server's own ``get_path``, ``refine_path``, ``exe_path`` and ``recovery`` in a slot of its own,
and does nothing an outside executive could not do. All that happens comes as messages into one mailbox and is handled
in order by one thread, so nothing can be lost between two callbacks.

======================  =====================================================================================
event                   what follows
======================  =====================================================================================
plan found              refine it (``plan_refiner``), follow it; while driving: swap the path without stopping
plan failed             recover (trigger *plan*), else end with the planner's code
plan failed, driving    ``replan_failed_policy``: keep the old path | stop and end | recover
path followed           succeeded
following failed        INVALID_PATH .. INTERNAL_ERROR end the goal, any other code: recover (trigger *control*)
robot oscillates        stop, recover (trigger *oscillation*), else end with OSCILLATION
recovery over           plan again, whatever its outcome
via pose passed         it is dropped; plans from now on lead through those left (``actions.via_poses``)
new goal                takes over: the old one ends CANCELED, the robot drives on until the new plan is there
cancel                  cancel the sub-goals, wait for their ends, end CANCELED
======================  =====================================================================================

A robot that is stuck (failures of one kind at one place, again and again) gets the behaviours of
``escalation_behaviors`` instead of those of the list, and so does one whose list is used up; see
``actions.stuck_monitor``. One that is blocked where it meets robots that announce their paths runs the behaviour for
``actions.meetings`` first. Without an escalation and alone, the machine is that of Move Base Flex.

Each behaviour of the list runs at most once until the list is reset: by a plan after trigger *plan*, by
``oscillation_distance`` of motion after the other two (upstream forgets that for *control*).
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import Action, GoalJob
from mbf_abstract.actions.exe_path import ExePathAction
from mbf_abstract.actions.get_path import GetPathAction
from mbf_abstract.actions.meetings import behavior_for_meetings
from mbf_abstract.actions.move_base_machine import MoveBaseMachine, via_of
from mbf_abstract.actions.recovery import RecoveryAction
from mbf_abstract.actions.refine_path import RefinePathAction
from mbf_abstract.actions.sub_goals import SubActions
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.execution.plan_check import area_in_global_frame, in_global_frame, tolerance_problem
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.feedback_types import MoveBaseFeedback
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import MoveBaseResult
from mbf_abstract.outcomes import MoveBaseOutcome
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.plugin_table import PluginTable

Handle = GoalHandle[MoveBaseGoal, MoveBaseResult, MoveBaseFeedback]
Job = GoalJob[MoveBaseGoal, MoveBaseResult, MoveBaseFeedback]


class MoveBaseAction(Action[MoveBaseGoal, MoveBaseResult, MoveBaseFeedback]):
    """Goes to poses."""

    name = "move_base"
    canceled_outcome = MoveBaseOutcome.CANCELED
    invalid_plugin_outcome = MoveBaseOutcome.FAILURE
    internal_error_outcome = MoveBaseOutcome.INTERNAL_ERROR

    def __init__(
        self,
        runtime: Runtime,
        plugins: PluginTable,
        get_path: GetPathAction,
        exe_path: ExePathAction,
        recovery: RecoveryAction,
        refine_path: RefinePathAction,
    ) -> None:
        super().__init__(runtime)
        self._plugins = plugins
        self._sub_actions = SubActions(get_path, exe_path, recovery, refine_path)

    def _check(self, goal: MoveBaseGoal) -> tuple[int, str] | None:
        """Accept only names that are loaded and tolerances that make sense."""
        wanted = [(PluginKind.PLANNER, goal.planner), (PluginKind.CONTROLLER, goal.controller)]
        parameters = self.runtime.parameters
        behaviors = [*(goal.recovery_behaviors or ()), *parameters.escalation_behaviors]
        behaviors += filter(None, [behavior_for_meetings(self.runtime, self._plugins)])
        wanted += [(PluginKind.RECOVERY, name) for name in behaviors]
        if refiner := parameters.plan_refiner:
            wanted.append((PluginKind.REFINER, refiner))
        for kind, name in wanted:
            problem = self._plugins.problem(kind, name)
            if problem:
                return MoveBaseOutcome.FAILURE, problem
        problem = tolerance_problem(goal)
        if goal.via and goal.goal_area is not None:
            problem = problem or "via poses lead to a target pose, not to a goal area; give one of the two"
        return (MoveBaseOutcome.FAILURE, problem) if problem else None

    def execute(self, job: Job) -> MoveBaseResult:
        """Run the state machine; the goal it ends with may be a later one than it began with."""
        job.report_started()
        try:
            self.runtime.robot.pose()
            target, via = self._target(job.handle), via_of(job.handle.goal, self.runtime)
            area = area_in_global_frame(job.handle.goal.goal_area, self.runtime)
        except (RobotStateError, TransformError) as error:
            return self.make_result(job.handle, MoveBaseOutcome.TF_ERROR, str(error))
        machine = MoveBaseMachine(self._sub_actions, self._plugins, job, target, via, area)
        with job.open_to_take_over(lambda goal: True, machine.wake):
            outcome, message = machine.run()
        return self.make_result(job.handle, outcome, message)

    def _target(self, handle: Handle) -> Pose:
        """Target pose in the global frame; raises TransformError."""
        return in_global_frame(handle.goal.target_pose, self.runtime)

    def make_result(self, handle: Handle, outcome: int, message: str) -> MoveBaseResult:
        """Result with the robot's present pose and its distance to the target."""
        try:
            pose, target = self.runtime.robot.pose(), self._target(handle)
        except (RobotStateError, TransformError):
            return MoveBaseResult(int(outcome), message)
        return MoveBaseResult(
            int(outcome),
            message,
            final_pose=pose,
            dist_to_goal=pose.distance_to(target),
            angle_to_goal=pose.angle_to(target),
        )

    def _goal_data(self, goal: MoveBaseGoal) -> dict[str, Any]:
        return {"target": list(goal.target_pose.position), "planner": goal.planner, "controller": goal.controller}
