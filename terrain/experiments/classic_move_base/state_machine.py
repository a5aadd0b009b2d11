"""The fixed state machine of ROS 1's ``move_base`` on top of the split actions, for comparison with other executives.

Its behaviour is that of the published source, with its peculiarities: one failing control cycle costs a new plan; the
recoveries form one fixed list, whatever has failed; patience of control counts from the last valid command and is not
renewed by a recovery. Use it to measure what a tree gains. For a robot use the ``move_base`` action or a tree.

=============  ============================================================================================
state          what happens in it
=============  ============================================================================================
PLANNING       the planner is asked until it has a plan, its patience is over or its retries are used up
CONTROLLING    the newest plan is followed
CLEARING       the next behaviour of the list runs, then PLANNING; abort when the list is used up
=============  ============================================================================================

Where it differs: a running behaviour can be canceled, a controller's exception ends the goal, and a hanging plugin is
the server's business. During ``run`` the server's own retries and oscillation watch are off: this machine does both.
"""

from __future__ import annotations

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import EventKind
from mbf_abstract.executives.mission import MissionContext
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.goal_types import ExePathGoal, RecoveryGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import ActionResult, MoveBaseResult
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import MoveBaseOutcome, is_success
from mbf_abstract.plugins import PluginKind
from mbf_abstract.time.clock import TIME_RESOLUTION
from terrain.experiments.classic_move_base.mailbox import Mailbox
from terrain.experiments.classic_move_base.planner import ClassicPlanner
from terrain.experiments.classic_move_base.settings import (
    ABORT_OUTCOMES,
    CANNOT_FOLLOW,
    ClassicSettings,
    ClassicState,
    Trigger,
)


class ClassicMoveBase:
    """Goes to one target at a time.

    Parameters
    ----------
    planner, controller : str
        Empty = the first one loaded.
    """

    def __init__(
        self, navigator: Navigator, settings: ClassicSettings | None = None, planner: str = "", controller: str = ""
    ) -> None:
        self.settings = settings or ClassicSettings()
        self._navigator = navigator
        self._planner_name = planner
        self._controller_name = controller
        self._server = navigator.server
        self._clock = navigator.server.runtime.clock
        self._mailbox = Mailbox(self._clock)

    # ----------------------------------------------------------------------------------------- client
    def run(self, target: Pose) -> MoveBaseResult:
        """Go to ``target``; returns when the goal has ended, with the robot standing and no goal left."""
        self._begin(target)
        try:
            with self.settings.imposed_on(self._server):
                end = self._work()
        finally:
            self._mission.end_goals(self._mailbox.closed or "move_base is over")
        return self._result(end, target)

    def cancel(self, reason: str = "canceled from outside") -> None:
        """End the present run soon; may be called from any thread, never waits."""
        self._mailbox.close(reason)

    # --------------------------------------------------------------------------------------- the loop
    def _begin(self, target: Pose) -> None:
        """A new goal: everything starts afresh, the list of recoveries too."""
        now = self._clock.now()
        self._mailbox.open()
        self._mission = MissionContext(self._navigator, target)
        self._planner = ClassicPlanner(self._mission, self._planner_name, self.settings.planner_frequency, self._post)
        self._planner.wake()
        names = self.settings.recovery_behaviors
        self._behaviors = self._server.plugins.names(PluginKind.RECOVERY) if names is None else list(names)
        self._state = ClassicState.PLANNING
        self._trigger = Trigger.PLANNING
        self._recovery_index = 0
        self._last_valid_control = self._last_oscillation_reset = now
        self._oscillation_pose: Pose | None = None
        self._new_plan = False
        self._drive: AnyGoalHandle | None = None
        self._recovery: AnyGoalHandle | None = None

    def _work(self) -> ActionResult:
        """Serve messages when they come and the control cycle at its rate, until there is an end."""
        end: ActionResult | None = None
        next_cycle = self._clock.now()
        while end is None:
            if self._mailbox.closed:
                return ActionResult(MoveBaseOutcome.CANCELED, self._mailbox.closed)
            self._planner.start_if_due()
            message = self._mailbox.next(min(next_cycle, self._planner.due))
            if message is not None:
                end = self._react(*message)
            elif self._clock.now() >= next_cycle - TIME_RESOLUTION:
                next_cycle += 1.0 / self.settings.controller_frequency
                end = self._cycle()
        return end

    def _post(self, handle: AnyGoalHandle) -> None:
        self._mailbox.post(handle)

    def _react(self, handle: AnyGoalHandle, feedback: ExePathFeedback | None) -> ActionResult | None:
        if handle is self._drive:
            if feedback is None:
                return self._on_drive_done(handle)
            self._on_command(feedback)
        elif handle is self._recovery:
            self._on_recovery_done()
        else:
            self._on_plan_done(handle)
        return None

    # --------------------------------------------------------------------------------------- messages
    def _on_plan_done(self, handle: AnyGoalHandle) -> None:
        was_running = self._planner.running
        result = self._planner.take_result(handle)
        if result is None:
            return
        if result.path is not None:
            self._mission.take_plan(result)
            self._new_plan = True
            if was_running:
                self._enter(ClassicState.CONTROLLING)
        elif self._state is ClassicState.PLANNING:
            self._planner.retries += 1
            limit, patience = self.settings.max_planning_retries, self.settings.planner_patience
            too_many = 0 <= limit < self._planner.retries
            if was_running and (too_many or self._is_over(self._planner.last_valid, patience)):
                self._planner.running = False
                self._clear(Trigger.PLANNING)

    def _on_command(self, feedback: ExePathFeedback) -> None:
        """Take in one control cycle of the controller."""
        self._mission.feedback = feedback
        if is_success(feedback.outcome):
            self._last_valid_control = self._clock.now()
            if self._trigger is Trigger.CONTROLLING:
                self._recovery_index = 0

    def _on_drive_done(self, handle: AnyGoalHandle) -> ActionResult | None:
        self._drive = None
        result: ActionResult | None = handle.result
        assert result is not None
        if result.success:
            return ActionResult(MoveBaseOutcome.SUCCESS, "Goal reached.")
        if result.outcome in CANNOT_FOLLOW:
            return ActionResult(result.outcome, f"Failed to pass global plan to the controller: {result.message}")
        if self._state is not ClassicState.CONTROLLING:
            return None
        if self._is_over(self._last_valid_control, self.settings.controller_patience):
            self._clear(Trigger.CONTROLLING)
        else:
            self._planner.restart_patience()
            self._enter(ClassicState.PLANNING)
            self._planner.wake()
        return None

    def _on_recovery_done(self) -> None:
        """Plan again, whether the behaviour has worked or not."""
        self._recovery = None
        self._last_oscillation_reset = self._clock.now()
        self._planner.restart_patience()
        self._recovery_index += 1
        self._enter(ClassicState.PLANNING)

    # -------------------------------------------------------------------------------------- the cycle
    def _cycle(self) -> ActionResult | None:
        """One turn of the control loop; the behaviour of a recovery blocks it."""
        if self._recovery is not None:
            return None
        self._watch_motion()
        if self._new_plan:
            self._new_plan = False
            if self._trigger is Trigger.PLANNING:
                self._recovery_index = 0
            if self._state is ClassicState.CONTROLLING:
                self._follow_plan()
        if self._state is ClassicState.PLANNING:
            self._planner.wake()
        elif self._state is ClassicState.CONTROLLING:
            timeout = self.settings.oscillation_timeout
            if timeout > 0.0 and self._is_over(self._last_oscillation_reset, timeout):
                self._clear(Trigger.OSCILLATION)
        elif not self._mission.robot_is_stopping:
            return self._next_recovery()
        return None

    def _watch_motion(self) -> None:
        try:
            pose = self._mission.robot_pose()
        except RobotStateError:
            return  # the running action stops the robot and reports it
        reference = self._oscillation_pose
        if reference is None or pose.distance_to(reference) >= self.settings.oscillation_distance:
            self._oscillation_pose = pose
            self._last_oscillation_reset = self._clock.now()
            if self._trigger is Trigger.OSCILLATION:
                self._recovery_index = 0

    def _follow_plan(self) -> None:
        """Hand the plan over; a controller that is driving takes it without stopping."""
        assert self._mission.path is not None
        self._drive = self._mission.send(ExePathGoal(self._mission.path, controller=self._controller_name))
        self._drive.subscribe(self._post)

    def _next_recovery(self) -> ActionResult | None:
        enabled = self.settings.recovery_behavior_enabled
        if enabled and self._recovery_index < len(self._behaviors):
            self._recovery = self._mission.send(RecoveryGoal(self._behaviors[self._recovery_index]))
            self._recovery.subscribe(lambda handle: self._post(handle) if handle.done else None)
            return None
        return ActionResult(ABORT_OUTCOMES[self._trigger], self._trigger.value)

    def _clear(self, trigger: Trigger) -> None:
        """Stop the robot and go on with a recovery."""
        self._trigger = trigger
        if self._drive is not None:
            self._drive.cancel(f"recovery, trigger {trigger.name.lower()}")
        self._enter(ClassicState.CLEARING)

    def _is_over(self, since: float, seconds: float) -> bool:
        return self._clock.now() > since + seconds + TIME_RESOLUTION

    def _enter(self, state: ClassicState) -> None:
        if state is not self._state:
            change = {"old": self._state.value, "new": state.value, "trigger": self._trigger.name.lower()}
            self._server.runtime.events.emit(EventKind.STATE_CHANGED, "classic_move_base", **change)
            self._state = state

    def _result(self, end: ActionResult, target: Pose) -> MoveBaseResult:
        try:
            pose = self._mission.robot_pose()
        except RobotStateError:
            return MoveBaseResult(end.outcome, end.message)
        return MoveBaseResult(end.outcome, end.message, pose, pose.distance_to(target), pose.angle_to(target))
