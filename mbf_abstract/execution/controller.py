"""Runs a controller: the loop that drives (reference: ``mbf.md`` 4.4, with the safe default everywhere).

Each period, in this order: a new plan? canceled? paused? pose and velocity fresh, map current? arrived? stuck or
oscillating? then the plugin is asked for a command, the command is judged and sent, and feedback is published.
Whatever ends the loop, the lease is given back and the robot stands. Differences to upstream: ``docs/decisions``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from mbf_abstract.drive.command_delay import CommandDelay
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.drive.velocity_gate import Lease
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.arrival import ArrivalCheck, StopsAtGoal
from mbf_abstract.execution.controller_state import ControllerEnd, ControllerState, Plan
from mbf_abstract.execution.motion_watch import MotionWatch
from mbf_abstract.execution.plugin_answer import PluginFault, PluginNonFinite
from mbf_abstract.execution.plugin_run import Abandoned, PluginRun
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import AbstractController, ControlRequest, ControlResult
from mbf_abstract.time.clock import Stopwatch

T = TypeVar("T")


class ControllerExecution:
    """One exe_path goal's (or, after plan updates, several goals') control loop.

    Parameters
    ----------
    run : PluginRun
        Supervises the plugin calls; its patience watch is restarted by every valid command.
    take_new_plan : callable
        Answers a plan that came for this running execution, at most once each, else None; raises TransformError for
        a path that cannot be transformed to the global frame.
    on_cycle : callable
        Called with the robot's pose and the result of every cycle that asked the plugin, e.g. to publish feedback.

    Attributes
    ----------
    state : ControllerState
    last_result : ControlResult, optional
        The plugin's last answer; None if it was never asked for a command.
    """

    def __init__(
        self,
        run: PluginRun[AbstractController],
        take_new_plan: Callable[[], Plan | None],
        on_cycle: Callable[[Pose, ControlResult], None],
    ) -> None:
        self._run = run
        self._runtime = run.runtime
        self._controller = run.plugin.instance
        self._take_new_plan = take_new_plan
        self._on_cycle = on_cycle
        self._plan: Plan | None = None
        self._failures = self._cycles = self._failed_cycles = 0
        self.last_result: ControlResult | None = None
        self._motion = MotionWatch(run.runtime)
        self._graceful_stop: Stopwatch | None = None
        self._stops, self._delay = StopsAtGoal(run.runtime.clock), CommandDelay()
        self._lease: Lease | None = None
        self.state = ControllerState.INITIALIZED

    def execute(self) -> ControllerEnd:
        """Drive until the loop ends; the robot stands when this returns."""
        self._enter(ControllerState.STARTED)
        if not self._run.acquire_plugin():
            if self._run.canceled:
                return self._canceled()
            return self._end(ControllerState.PAT_EXCEEDED, ExePathOutcome.PAT_EXCEEDED, self._run.waited)
        self._lease = lease = self._runtime.gate.acquire(f"exe_path {self._run.plugin.name}")
        if lease is None:
            holder = self._runtime.gate.holder
            text = f"the robot is driven by {holder}" if holder else "the velocity gate is closed"
            return self._end(ControllerState.INTERNAL_ERROR, ExePathOutcome.FAILURE, text)
        end = ControllerEnd(ControllerState.STOPPED, ExePathOutcome.STOPPED, "stopped")
        began = self._runtime.clock.now()
        try:
            end = self._loop(lease)
            return end
        finally:
            try:
                self._write_to_robot(lambda: lease.release(stop=self._stops_at(end.state), reason=end.state.value))
            finally:
                self._report_cycles(began)

    def stop_robot(self, reason: str) -> None:
        """Take the lease away from the loop, from another thread: a call of it hangs. Never waits."""
        if self._lease is not None:
            self._lease.revoke(reason)

    def _write_to_robot(self, write: Callable[[], T]) -> T:
        """Let the gate call the driver, supervised: it may block."""
        return self._run.call_beside("the robot's send_command()", write)

    # -------------------------------------------------------------------------------------- the cycle
    def _loop(self, lease: Lease) -> ControllerEnd:
        clock = self._runtime.clock
        next_cycle = clock.now()
        while True:
            try:
                end = self._cycle(lease)
            except PluginFault as fault:
                end = self._end(ControllerState.INTERNAL_ERROR, ExePathOutcome.INTERNAL_ERROR, str(fault))
            if end is not None:
                return end
            next_cycle += 1.0 / self._runtime.parameters.controller_frequency
            if next_cycle < clock.now():  # over-run: keep the rate, drop the missed cycles
                next_cycle = clock.now()
            clock.sleep_until(next_cycle)

    def _cycle(self, lease: Lease) -> ControllerEnd | None:
        """One control cycle; the steps of the module's docstring. Returns the end, or None to go on."""
        end = self._adopt_new_plan()
        if end is None and self._run.canceled:
            end = self._handle_cancel()
        if end is not None or self._hold_while_paused(lease):
            return end
        robot = self._runtime.robot
        try:  # first: no map stays current whose robot is lost, and of the two only a map may come back by a recovery
            pose, measured = robot.pose(), self._run.call_beside("the robot's odometry()", robot.measured_velocity)
        except RobotStateError as error:
            return self._hold(lease, ExePathOutcome.TF_ERROR, str(error))
        if problem := self._map_problem():
            return self._hold(lease, ExePathOutcome.MAP_ERROR, problem)
        velocity = measured or Twist()
        if self._is_arrived(pose, velocity):
            return self._come_to_rest(pose, velocity, lease)
        end = self._drive_back_in(pose) or self._watch_motion(pose, measured)
        if end is not None:
            return end
        result = self._compute(pose, measured)
        end = self._judge(result, lease)
        self._on_cycle(pose, result)
        self._delay.note(self._runtime.clock.now(), self._runtime.gate.last_command)
        return end

    def _adopt_new_plan(self) -> ControllerEnd | None:
        try:
            plan = self._take_new_plan()
        except TransformError as error:
            return self._end(ControllerState.INVALID_PLAN, ExePathOutcome.TF_ERROR, str(error))
        if plan is None:
            if self._plan is None:
                return self._end(ControllerState.NO_PLAN, ExePathOutcome.INVALID_PATH, "started without a path")
            return None
        if len(plan.path) == 0:
            return self._end(ControllerState.EMPTY_PLAN, ExePathOutcome.INVALID_PATH, "the path has no poses")
        self._controller.refusal = ""
        if not self._run.ask_whether("set_plan", partial(self._controller.set_plan, plan.path)):
            reason = self._controller.refusal
            text = f"controller {self._run.plugin.name!r} refused the path{reason and f': {reason}'}"
            return self._end(ControllerState.INVALID_PLAN, ExePathOutcome.INVALID_PATH, text)
        if self._plan is None or plan.arrival.is_elsewhere(self._plan.arrival):
            self._stops.reset()
        self._plan = plan
        self._graceful_stop = None
        if self.state is ControllerState.STOPPING:
            self._enter(ControllerState.STARTED)
        return None

    def _handle_cancel(self) -> ControllerEnd | None:
        """Let a controller that can stop smoothly do so, for at most ``cancel_grace``; else end now."""
        if self._graceful_stop is None:
            if self._run.handle.paused or not self._run.call("cancel", self._controller.cancel):
                return self._canceled()
            self._graceful_stop = Stopwatch(self._runtime.clock)
        if self._graceful_stop.elapsed > self._runtime.parameters.cancel_grace:
            return self._canceled()
        return None

    def _hold_while_paused(self, lease: Lease) -> bool:
        if not self._run.handle.paused:
            if lease.paused:
                lease.resume()
                self._motion.resume()
            return False
        if not lease.paused:
            self._write_to_robot(lease.pause)
            self._motion.pause()
            self._enter(ControllerState.PAUSED)
        return True

    def _map_problem(self) -> str:
        """Why the map must not be driven on: also where its hook raises."""
        problem: object = self._ask_map("map_problem", self._runtime.map_hooks.map_problem, failed=str)
        return str(problem) if problem else ""

    def _ask_map(self, name: str, hook: Callable[[], T], failed: Callable[[str], T]) -> T:
        """Call a hook of the map; where it raises, ``failed`` makes an answer of the reason."""
        try:
            return self._run.call_beside(f"the map's {name}()", hook)
        except Abandoned:
            raise
        except Exception as error:
            return failed(f"{name} raised {type(error).__name__}: {error_text(error)}")

    def _hold(self, lease: Lease, outcome: int, reason: str) -> ControllerEnd | None:
        """Stop the robot, which must not be driven on old data; the end once patience is over."""
        self._write_to_robot(lease.stop)
        self._enter(ControllerState.HOLDING)
        return self._end(ControllerState.PAT_EXCEEDED, outcome, reason) if self._run.is_patience_over() else None

    def _is_arrived(self, pose: Pose, velocity: Twist) -> bool:
        """Ask while the robot drives, and once more when it stands: it may have slid out of the tolerance."""
        is_stopping = self.state is ControllerState.STOPPING
        if is_stopping and not self._stands(velocity):
            return True
        assert self._plan is not None
        self._plan.tracker.update(pose.position)
        slack = self._runtime.relaxation.slack(self._runtime.clock.now())
        arrival = self._plan.arrival.relaxed(slack)
        return self._stops.is_arrived(arrival, pose, is_stopping, partial(self._is_reached, pose, arrival))

    def _is_reached(self, pose: Pose, arrival: ArrivalCheck, dist_tolerance: float) -> bool:
        assert self._plan is not None
        ask = partial(self._controller.is_goal_reached, pose, dist_tolerance, arrival.angle_tolerance)
        plugin_agrees = self._run.ask_whether("is_goal_reached", ask)
        return arrival.reached(pose, self._plan.tracker, plugin_agrees)

    def _come_to_rest(self, pose: Pose, velocity: Twist, lease: Lease) -> ControllerEnd | None:
        """At the goal: with ``force_stop_at_goal`` the goal succeeds once the robot stands, else at once."""
        assert self._plan is not None
        if not self._runtime.parameters.force_stop_at_goal or self._stands(velocity):
            return self._end(ControllerState.ARRIVED_GOAL, ExePathOutcome.SUCCESS, "goal reached")
        if self.state is not ControllerState.STOPPING:
            self._stops.begin(self._plan.arrival, pose)
            self._run.patience_watch.restart()
            self._enter(ControllerState.STOPPING)
        self._write_to_robot(lease.stop)
        if self._run.is_patience_over():
            text = f"the robot is at its goal but still moves at {velocity.speed:.2f} m/s, {velocity.wz:.2f} rad/s"
            return self._end(ControllerState.PAT_EXCEEDED, ExePathOutcome.PAT_EXCEEDED, text)
        return None

    def _drive_back_in(self, pose: Pose) -> ControllerEnd | None:
        """Let a robot that stands outside of its goal's tolerance drive again; the end where that did not help."""
        assert self._plan is not None
        problem = self._stops.drive_back(self._plan.arrival, pose) if self.state is ControllerState.STOPPING else ""
        return self._end(ControllerState.MISSED_GOAL, ExePathOutcome.MISSED_GOAL, problem) if problem else None

    def _stands(self, velocity: Twist) -> bool:
        limit = self._runtime.parameters.goal_max_speed
        return velocity.is_stopped(limit, limit)

    def _compute(self, pose: Pose, measured: Twist | None) -> ControlResult:
        self._enter(ControllerState.CONTROLLING)
        delay = self._runtime.parameters.command_delay
        then = self._delay.ahead(self._runtime.clock.now(), delay, pose, measured or Twist())
        request = ControlRequest(*then, self._run.handle.cancel_token)
        compute = partial(self._controller.compute_velocity_commands, request)
        try:
            result = self._run.ask("compute_velocity_commands", compute, ControlResult)
        except PluginNonFinite as error:
            result = ControlResult(ExePathOutcome.NO_VALID_CMD, str(error))
        if result.success and result.command is None:
            result = ControlResult(ExePathOutcome.NO_VALID_CMD, f"{self._run.plugin.title} gave no command")
        elif result.success:
            result = self._avoid_contact(pose, self._runtime.velocity_or_command(measured), result)
        self.last_result = result
        self._cycles += 1
        self._failed_cycles += not result.success
        return result

    def _avoid_contact(self, pose: Pose, velocity: Twist, result: ControlResult) -> ControlResult:
        """Let the map slow the command down: to its speed limits, and where the robot would touch what moves."""
        hook = partial(self._runtime.as_safe, pose, velocity, result, self._controller)
        return self._ask_map("avoid_contact", hook, failed=partial(ControlResult, ExePathOutcome.MAP_ERROR))

    # ------------------------------------------------------------------------------- judging a command
    def _judge(self, result: ControlResult, lease: Lease) -> ControllerEnd | None:
        """Send a good command; stop and count a bad one."""
        if result.outcome == ExePathOutcome.CANCELED:
            return self._canceled(result.message)
        if self._run.patience_exceeded:  # by this very call: its command is as old as the pose it was made from
            return self._patience_end()
        if self._run.canceled and self._graceful_stop is None:  # while it computed; a new command is not wanted
            return self._handle_cancel()
        if result.success and result.command is not None:
            self._motion.note_command()
            if self._write_to_robot(partial(lease.send, result.command)):
                self._failures = 0
                self._run.patience_watch.restart()
                self._enter(ControllerState.GOT_LOCAL_CMD)
                return None
            result = ControlResult(ExePathOutcome.FAILURE, f"the command did not reach the robot: {lease.problem}")
            self.last_result = result
        return self._count_failure(result, lease)

    def _count_failure(self, result: ControlResult, lease: Lease) -> ControllerEnd | None:
        """Stop after a failed cycle; the end, after too many, after the patience, or where asking again is vain."""
        parameters = self._runtime.parameters
        self._failures += 1
        command = None if parameters.force_stop_on_retry else result.command
        self._write_to_robot(lease.stop if command is None else partial(lease.send, command))
        if result.outcome == ExePathOutcome.MISSED_GOAL:  # a robot that stands does not get back before its goal
            return self._end(ControllerState.MISSED_GOAL, result.outcome, result.message)
        if self._failures > parameters.controller_max_retries >= 0:
            return self._end(ControllerState.MAX_RETRIES, result.outcome, result.message)
        if self._run.is_patience_over():
            return self._patience_end()
        self._enter(ControllerState.NO_LOCAL_CMD)
        return None

    def _watch_motion(self, pose: Pose, measured: Twist | None) -> ControllerEnd | None:
        assert self._plan is not None
        problem = self._motion.problem(pose, measured, self._plan.tracker)
        if problem is None:
            return None
        stuck = problem[0] == ExePathOutcome.ROBOT_STUCK
        return self._end(ControllerState.ROBOT_DISABLED if stuck else ControllerState.OSCILLATING, *problem)

    # ------------------------------------------------------------------------------------------- ends
    def _canceled(self, message: str = "") -> ControllerEnd:
        text = self._run.handle.cancel_reason or message or "the controller canceled"
        return self._end(ControllerState.CANCELED, ExePathOutcome.CANCELED, text)

    def _patience_end(self) -> ControllerEnd:
        last = self.last_result.message if self.last_result is not None else ""
        tail = f"; last message of {self._run.plugin.title}: {last}" if last else ""
        text = f"no valid command for {self._run.patience:g} s{tail}"
        return self._end(ControllerState.PAT_EXCEEDED, ExePathOutcome.PAT_EXCEEDED, text)

    def _end(self, state: ControllerState, outcome: int, message: str) -> ControllerEnd:
        self._enter(state)
        return ControllerEnd(state, int(outcome), message)

    def _stops_at(self, state: ControllerState) -> bool:
        if state is ControllerState.ARRIVED_GOAL:
            return self._runtime.parameters.force_stop_at_goal
        return state is not ControllerState.CANCELED or self._runtime.parameters.force_stop_on_cancel

    def _report_cycles(self, began: float) -> None:
        """Record how often the plugin was asked; an event for each call would drown all others."""
        self._runtime.events.emit(
            EventKind.CONTROL_LOOP,
            self._run.plugin.name,
            goal_id=self._run.handle.id,
            began=began,
            cycles=self._cycles,
            failed=self._failed_cycles,
        )

    def _enter(self, state: ControllerState) -> None:
        """Record a change of state; the two states of a healthy cycle are not worth an event each."""
        quiet = {ControllerState.CONTROLLING, ControllerState.GOT_LOCAL_CMD}
        if state is not self.state and not (state in quiet and self.state in quiet):
            self._run.report_state("controller_execution", self.state.value, state.value)
        self.state = state
