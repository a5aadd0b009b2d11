"""The state machine behind ``move_base``; its table of events is in ``actions.move_base``."""

from __future__ import annotations

from typing import Any

from mbf_abstract.actions.action import PREEMPTED
from mbf_abstract.actions.manoeuvre_kept import goes_on, rest_of
from mbf_abstract.actions.move_base_states import MoveBaseState, Trigger
from mbf_abstract.actions.recovery_sequence import RecoverySequence
from mbf_abstract.actions.sub_goals import Job, SubActions, SubGoals
from mbf_abstract.actions.via_poses import ViaPoses
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.motion_watch import OscillationDetector
from mbf_abstract.execution.plan_check import area_in_global_frame, in_global_frame
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.arrival_tolerance import ends_beside, planned_tolerance, tolerance_left
from mbf_abstract.goals.feedback_types import ExePathFeedback, MoveBaseFeedback
from mbf_abstract.goals.goal_area import GoalArea
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import GetPathResult, RefinePathResult
from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome, RefinePathOutcome
from mbf_abstract.server.plugin_table import PluginTable
from mbf_abstract.time.clock import Stopwatch

NO_REPLAN_WITHIN = 0.1  # m from the goal
FATAL = range(ExePathOutcome.INVALID_PATH, ExePathOutcome.INTERNAL_ERROR + 1)

End = tuple[int, str]


def via_of(goal: MoveBaseGoal, runtime: Runtime) -> ViaPoses:
    """Via poses of a goal in the global frame; raises TransformError."""
    return ViaPoses([in_global_frame(pose, runtime) for pose in goal.via])


class MoveBaseMachine:
    """One run of move_base, for one goal or several that take over from each other."""

    def __init__(
        self,
        sub_actions: SubActions,
        plugins: PluginTable,
        job: Job,
        target: Pose,
        via: ViaPoses,
        area: GoalArea | None = None,
    ) -> None:
        self._runtime = job.action.runtime
        self._job = job
        self._target, self._via = target, via
        self._state = MoveBaseState.GET_PATH
        self._goals = SubGoals(sub_actions, job, area)
        self._followed: Path | None = None
        self._unrefined = ""  # what is said of the refiner that failed on the followed plan by a fault
        self._failure: tuple[Trigger, End] | None = None
        self._ending: End | None = None
        self._recoveries = RecoverySequence(self._runtime, plugins)
        self._oscillation = OscillationDetector(self._runtime.clock)
        self._replan_watch = Stopwatch(self._runtime.clock)
        self._planned_floor = self._followed_floor = self._runtime.map_hooks.floors_taken()

    def wake(self) -> None:
        """Look again at the goal: it was canceled, paused or resumed, or a newer one is on offer."""
        self._goals.wake()

    # ------------------------------------------------------------------------------------ the loop
    def run(self) -> End:
        """Work until the goal has its end."""
        self._job.handle.on_wake(self.wake)
        self._recoveries.restart()
        self._ask_for_plan()
        try:
            end = None
            while end is None:
                end = self._react(self._goals.next_message(self._has_news, self._time_to_replan))
            return end
        finally:  # e.g. a replanning that still runs when the robot arrives
            self._goals.cancel("move_base is over")
            self._recoveries.finish()

    def _react(self, message: AnyGoalHandle | None) -> End | None:
        handle = self._job.handle
        self._forward_pause()
        if handle.cancel_requested and self._state is not MoveBaseState.CANCELING:
            self._cancel_sub_goals(MoveBaseState.CANCELING)
        if self._state is not MoveBaseState.CANCELING:
            self._take_offer()
        if self._state is MoveBaseState.CANCELING:
            return None if self._goals.unfinished else self._stopped_end()
        if message is None:
            self._replan_if_due()
            return None
        if not message.done:
            return self._on_feedback(message)
        if message is self._goals.plan:
            self._goals.plan = None
            return self._on_plan(message.result)
        if message is self._goals.follow:
            self._goals.follow = None
            return self._on_followed(message.result)
        if message is self._goals.recover:
            self._goals.recover = None
            return self._on_recovered(message.result)
        return None  # a sub-goal that another one has replaced

    def _has_news(self) -> bool:
        """Whether the goal was paused, resumed or canceled, all sub-goals are canceled, or a newer goal is on offer."""
        handle = self._job.handle
        paused = [self._oscillation.stopwatch.paused, *(one.paused for one in self._goals.unfinished)]
        if (not handle.paused) in paused:
            return True
        if self._state is MoveBaseState.CANCELING:
            return not self._goals.unfinished
        return self._job.offered or handle.cancel_requested

    # -------------------------------------------------------------------------------------- planning
    def _ask_for_plan(self) -> None:
        self._replan_watch.restart()
        self._planned_floor = self._runtime.map_hooks.floors_taken()
        if self._goals.follow is None:
            self._enter(MoveBaseState.GET_PATH)
        self._goals.send_plan(self._target, self._via.plan(), self._planned_tolerance())

    def _on_plan(self, result: Any) -> End | None:
        if isinstance(result, RefinePathResult) and result.refined_path is not None:  # the plan itself without success
            is_faulty = result.outcome == RefinePathOutcome.INTERNAL_ERROR
            self._unrefined = f"; its plan was not refined: {result.message}" if is_faulty else ""
            self._follow_path(result.refined_path)
            return None
        if result.success and result.path is not None:
            self._recoveries.note_plan()
            refiner = self._runtime.parameters.plan_refiner
            if refiner:
                self._goals.send_refinement(result.path, refiner)
            else:
                self._follow_path(result.path)
            return None
        if self._goals.follow is None:
            failure = (result.outcome, self._via.described(result.message))
            return failure if result.is_final else self._recover_from(Trigger.PLAN, failure)
        return self._on_replan_failed(result)

    def _on_replan_failed(self, result: GetPathResult) -> End | None:
        policy = self._runtime.parameters.replan_failed_policy
        taken_over = self._state is MoveBaseState.GET_PATH  # the old path leads to an old goal: never keep it
        outdated = taken_over or self._followed_floor != self._planned_floor  # or over an old floor
        if policy == "keep" and not outdated:
            return None
        failure = (result.outcome, f"replanning failed: {self._via.described(result.message)}")
        if (policy == "stop" and not taken_over) or (result.is_final and outdated):
            return self._end_after_stop(failure)
        self._stop_then_recover(Trigger.PLAN, failure)
        return None

    def _replan_if_due(self) -> None:
        due = self._time_to_replan()
        if due is not None and due <= 0.0:
            self._ask_for_plan()

    def _time_to_replan(self) -> float | None:
        """Seconds until the next replanning; None while there is none to come."""
        frequency = self._runtime.parameters.planner_frequency
        driving = self._state is MoveBaseState.EXE_PATH and self._goals.plan is None and not self._job.handle.paused
        if driving and self._planned_floor != self._runtime.map_hooks.floors_taken():
            return 0.0
        if frequency <= 0.0 or not driving or self._distance_to_goal() <= NO_REPLAN_WITHIN:
            return None
        return max(0.0, 1.0 / frequency - self._replan_watch.elapsed)

    def _distance_to_goal(self) -> float:
        feedback = self._goals.follow.feedback if self._goals.follow is not None and not self._via.left else None
        return feedback.dist_to_goal if feedback is not None else float("inf")

    # ------------------------------------------------------------------------------------- following
    def _follow_path(self, path: Path) -> None:
        if self._keeps_manoeuvre(path):
            return
        if problem := self._setback(path):
            self._stop_then_recover(Trigger.CONTROL, (ExePathOutcome.BLOCKED_PATH, problem))
            return
        if self._goals.follow is None:
            self._oscillation.reset()
            self._replan_watch.restart()
        self._via.follow(path)
        self._followed, self._followed_floor = path, self._planned_floor
        self._enter(MoveBaseState.EXE_PATH)
        self._goals.send_path(path, self._arrival_tolerance(path))

    def _setback(self, path: Path) -> str:
        """Why a newer plan for the same goal sets the robot back once too often; empty if it does not."""
        feedback = self._goals.follow.feedback if self._goals.follow is not None else None
        if feedback is None or self._state is not MoveBaseState.EXE_PATH:
            return ""
        return self._recoveries.note_new_path(path.length, feedback.distance_along_path)

    def _keeps_manoeuvre(self, path: Path) -> bool:
        """Whether the robot goes on with its manoeuvre instead of that of a newer plan for the same goal and floor."""
        old, feedback = self._followed, self._goals.follow.feedback if self._goals.follow is not None else None
        same = self._state is MoveBaseState.EXE_PATH and self._followed_floor == self._planned_floor
        if old is None or feedback is None or not same:
            return False
        to_go = feedback.distance_along_path
        if not goes_on(old, to_go, path) or self._obstacle_along(rest_of(old, to_go)):
            return False
        self._enter(self._state, kept=f"{to_go:.2f} m of a manoeuvre are left, the new plan has {path.length:.2f} m")
        return True

    def _obstacle_along(self, path: Path) -> str:
        try:
            return self._runtime.map_hooks.obstacle_along(path)
        except Exception as error:  # a map that cannot say keeps no robot on its way
            return error_text(error)

    def _planned_tolerance(self) -> float | None:
        """How far [m] from the target a plan may end; None = by the goal's area alone."""
        goal = self._job.handle.goal
        return goal.dist_tolerance if goal.goal_area is not None else planned_tolerance(self._dist_tolerance)

    def _arrival_tolerance(self, path: Path) -> float | None:
        """What a path that ends off the target leaves of the tolerance [m]; None = the server's."""
        goal, off = self._job.handle.goal, path[-1].distance_to(self._target)
        left = None if goal.goal_area is not None else tolerance_left(self._dist_tolerance, off)
        return goal.dist_tolerance if left is None else left

    def _how_far_off(self) -> str:
        """What is added where the path, driven to its end, leads to farther from the target than the tolerance."""
        path, is_area = self._followed, self._job.handle.goal.goal_area is not None
        off = 0.0 if path is None or is_area else path[-1].distance_to(self._target)
        return f"; its path {ends_beside(off, self._dist_tolerance)}" if off > self._dist_tolerance else ""

    @property
    def _dist_tolerance(self) -> float:
        """Arrival tolerance [m] of the goal, else the server's."""
        given = self._job.handle.goal.dist_tolerance
        return self._runtime.parameters.dist_tolerance if given is None else given

    def _on_feedback(self, message: AnyGoalHandle) -> End | None:
        if message is not self._goals.follow or message.feedback is None or self._state is not MoveBaseState.EXE_PATH:
            return None
        feedback: ExePathFeedback = message.feedback
        self._via.note_progress(feedback.distance_along_path, self._dist_tolerance)
        self._job.handle.publish_feedback(MoveBaseFeedback(**vars(feedback), via_left=len(self._via.left)))
        parameters, pose = self._runtime.parameters, feedback.current_pose
        self._recoveries.note_motion(pose)
        if self._oscillation.check(
            pose, parameters.oscillation_timeout, parameters.oscillation_distance, parameters.oscillation_angle
        ):
            text = f"the robot has made no progress in {parameters.oscillation_timeout:g} s"
            self._stop_then_recover(Trigger.OSCILLATION, (MoveBaseOutcome.OSCILLATION, text))
        return None

    def _on_followed(self, result: Any) -> End | None:
        if self._state is MoveBaseState.GET_PATH:  # the end of an older goal's path: the plan for this one comes
            return None
        if self._state is MoveBaseState.STOPPING:
            return self._go_on_after_stop()
        if result.success:
            return MoveBaseOutcome.SUCCESS, result.message + self._how_far_off() + self._unrefined
        if result.outcome in FATAL:
            return result.outcome, result.message
        self._goals.cancel_plan("following failed")
        if result.outcome == ExePathOutcome.OSCILLATION:
            return self._recover_from(Trigger.OSCILLATION, (MoveBaseOutcome.OSCILLATION, result.message))
        return self._recover_from(Trigger.CONTROL, (result.outcome, result.message))

    # -------------------------------------------------------------------------------------- recovery
    def _recover_from(self, trigger: Trigger, failure: End) -> End | None:
        """Run the behaviour that is due; without one the failure is the goal's end."""
        self._recoveries.note_failure(trigger, failure[0])
        behavior = self._recoveries.due_behavior(self._job.handle.goal.recovery_behaviors)
        if not behavior:
            return failure[0], self._recoveries.described(failure[1])
        self._enter(MoveBaseState.RECOVERY, behavior=behavior, trigger=trigger.value, failure=failure[1])
        self._goals.send_recovery(behavior)
        return None

    def _on_recovered(self, result: Any) -> End | None:
        self._recoveries.note_end(result.used_plugin, result.outcome)
        self._ask_for_plan()
        return None

    # -------------------------------------------------------------------------- new goal, cancel, pause
    def _take_offer(self) -> None:
        """Let a newer goal take over: a new plan is asked for, the robot drives on until it is there."""
        if not self._job.take_over(lambda handle: handle.on_wake(self.wake), PREEMPTED):
            return
        self._recoveries.restart()
        self._failure = None
        self._oscillation.reset()
        try:
            goal = self._job.handle.goal
            self._target, self._via = in_global_frame(goal.target_pose, self._runtime), via_of(goal, self._runtime)
            self._goals.area = area_in_global_frame(goal.goal_area, self._runtime)
        except TransformError as error:
            self._end_after_stop((MoveBaseOutcome.TF_ERROR, str(error)))
            return
        if self._state in (MoveBaseState.GET_PATH, MoveBaseState.EXE_PATH):
            self._goals.cancel_plan(PREEMPTED)
            self._ask_for_plan()
            self._enter(MoveBaseState.GET_PATH)

    def _cancel_sub_goals(self, state: MoveBaseState) -> None:
        self._enter(state)
        self._goals.cancel("move_base ends it")

    def _stop_then_recover(self, trigger: Trigger, failure: End) -> None:
        """Stop following; its end starts the recovery."""
        self._failure = trigger, failure
        self._cancel_sub_goals(MoveBaseState.STOPPING)
        self._goals.plan = None

    def _end_after_stop(self, end: End) -> End | None:
        """End the goal with ``end`` once all sub-goals are over."""
        self._ending = end
        self._cancel_sub_goals(MoveBaseState.CANCELING)
        return None if self._goals.unfinished else end

    def _go_on_after_stop(self) -> End | None:
        """The robot stands: recover from what made it stop, or plan for a goal that took over meanwhile."""
        if self._failure is not None:
            return self._recover_from(*self._failure)
        self._ask_for_plan()
        return None

    def _stopped_end(self) -> End:
        return self._ending or (MoveBaseOutcome.CANCELED, self._job.handle.cancel_reason)

    def _forward_pause(self) -> None:
        """Bring everything into the goal's state, whoever else has paused or resumed a sub-goal meanwhile."""
        paused = self._job.handle.paused
        for watch in (self._oscillation.stopwatch, self._replan_watch):
            watch.pause() if paused else watch.resume()
        self._goals.set_paused(paused)

    def _enter(self, state: MoveBaseState, **why: object) -> None:
        if state is not self._state or why:
            self._runtime.events.emit(
                EventKind.STATE_CHANGED,
                "move_base",
                goal_id=self._job.handle.id,
                old=self._state.value,
                new=state.value,
                **why,
            )
        self._state = state
