"""The controller execution; F-numbers are facts of the upstream tests, with their ids. Every test ends standing."""

import numpy as np
import pytest

from mbf_abstract.execution.arrival import ArrivalCheck
from mbf_abstract.execution.controller import ControllerExecution
from mbf_abstract.execution.controller_state import Plan
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome as Outcome
from mbf_abstract.plugins import ControlResult, PluginKind
from mbf_abstract.testing.faulty import drive, nan_command, no_command, slow

FAILS = ControlResult(Outcome.BLOCKED_PATH, "a chair")
FAILS_BUT_DRIVES = ControlResult(Outcome.BLOCKED_PATH, "a chair", Twist.planar(0.1))


def end_state(states, session):
    return states(session, "controller_execution")[-1]


def run_execution(session, plan):
    """Run a controller execution without its action, which would refuse such a plan."""
    handle = session.navigator.send(ExePathGoal(session.path_to(1.0)))
    session.clock.sleep(0.0)
    handle.cancel()
    handle.wait()
    session.clock.sleep(0.1)
    plugin = session.server.plugins.get(PluginKind.CONTROLLER, "")
    plans = [plan]
    run = PluginRun(session.server.runtime, plugin, handle, lambda: 5.0, lambda _: None)
    handle.cancel_requested = False
    with run:
        return ControllerExecution(run, lambda: plans.pop() if plans else None, lambda pose, result: None).execute()


def test_f277_started_without_a_plan(make_session):
    end = run_execution(make_session(), None)
    assert (end.state.value, end.outcome) == ("no_plan", Outcome.INVALID_PATH)


def test_f278_an_empty_plan(make_session):
    empty = Plan(Path.from_poses([]), ArrivalCheck(Pose.planar(0, 0), 0.1, 0.1))
    end = run_execution(make_session(), empty)
    assert (end.state.value, end.outcome) == ("empty_plan", Outcome.INVALID_PATH)


def test_f279_a_plan_that_the_plugin_refuses(make_session, states):
    session = make_session()
    session.controller.accepts_plan = False
    result = session.navigator.exe_path(session.path_to(2.0))
    assert end_state(states, session) == "invalid_plan"
    assert (result.outcome, result.message) == (Outcome.INVALID_PATH, "controller 'controller' refused the path")


def test_a_refused_plan_says_why_where_the_plugin_does(make_session):
    session = make_session()
    session.controller.set_plan = lambda path: session.controller.refuse("it has 21 poses")
    result = session.navigator.exe_path(session.path_to(2.0))
    assert result.message == "controller 'controller' refused the path: it has 21 poses"
    session.controller.set_plan = lambda path: False
    assert session.navigator.exe_path(session.path_to(2.0)).message == "controller 'controller' refused the path"


@pytest.mark.parametrize(("answer", "kind"), [(None, "NoneType"), (np.ones(3, bool), "ndarray"), ("yes", "str")])
def test_a_controller_that_neither_accepts_nor_refuses_its_plan_is_named(make_session, answer, kind):
    session = make_session()
    session.controller.set_plan = lambda path: answer
    result = session.navigator.exe_path(session.path_to(2.0))
    assert result.outcome == Outcome.INTERNAL_ERROR
    assert result.message == f"plugin 'controller' returned {kind} from set_plan, not bool"


def test_f280_without_a_robot_pose_it_holds_and_then_ends(make_session):
    session = make_session(controller_patience=2.0, tf_timeout=0.5)
    session.robot.publishes_pose = False
    session.clock.sleep(1.0)
    result = session.navigator.exe_path(Path.from_points([(0, 0, 0), (1, 0, 0)]))
    assert result.outcome == Outcome.TF_ERROR  # upstream: INTERNAL_ERROR, or TF_ERROR if the action was faster
    assert session.controller.requests == []
    assert (result.final_pose, result.dist_to_goal) == (None, float("inf"))


def test_f281_the_plugin_says_the_goal_is_reached(make_session, states):
    session = make_session()
    result = session.navigator.exe_path(Path.from_points([(0, 0, 0), (0.05, 0, 0)]))
    assert result.success
    assert states(session, "controller_execution") == ["started", "arrived_goal"]
    assert session.controller.requests == []
    assert result.plugin_outcome is None


def test_f282_a_controller_that_raises_is_an_internal_error(make_session, states):
    session = make_session()
    session.controller.play(drive(), KeyError("nothing"))
    result = session.navigator.exe_path(session.path_to(5.0))
    assert result.outcome == Outcome.INTERNAL_ERROR
    assert "KeyError in compute_velocity_commands" in result.message
    assert end_state(states, session) == "internal_error"


def test_f283_one_retry_is_one_failed_cycle_and_then_the_end(make_session, states):
    session = make_session(controller_max_retries=1)
    session.controller.play(FAILS)
    result = session.navigator.exe_path(session.path_to(5.0))
    assert states(session, "controller_execution") == [
        "started",
        "controlling",
        "no_local_cmd",
        "controlling",
        "max_retries",
    ]
    assert (result.outcome, result.message) == (Outcome.BLOCKED_PATH, "a chair")
    assert (result.plugin_outcome, result.plugin_message) == (Outcome.BLOCKED_PATH, "a chair")


def test_f284_unlimited_retries_go_on(make_session, states):
    session = make_session(controller_max_retries=-1)
    session.controller.play(FAILS)
    handle = session.navigator.send(ExePathGoal(session.path_to(5.0)))
    session.clock.sleep(2.02)
    assert not handle.done
    assert end_state(states, session) == "no_local_cmd"
    handle.cancel()
    handle.wait()


def test_f285_a_failure_after_patience_is_patience_exceeded(make_session, states):
    session = make_session(controller_patience=1.0)
    session.controller.play(FAILS)
    result = session.navigator.exe_path(session.path_to(5.0))
    assert end_state(states, session) == "pat_exceeded"
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert result.message == "no valid command for 1 s; last message of controller 'controller': a chair"
    assert (result.plugin_outcome, result.plugin_message) == (Outcome.BLOCKED_PATH, "a chair")


# ---------------------------------------------------------------------- the patience x retries table (mbf.md 4.2)
@pytest.mark.parametrize(
    ("retries", "patience", "calls", "outcome"),
    [
        (0, 0.0, 1, Outcome.BLOCKED_PATH),
        (0, 9.0, 1, Outcome.BLOCKED_PATH),
        (3, 0.0, 4, Outcome.BLOCKED_PATH),
        (3, 9.0, 4, Outcome.BLOCKED_PATH),
        (100, 1.02, 22, Outcome.PAT_EXCEEDED),
        (-1, 1.02, 22, Outcome.PAT_EXCEEDED),
    ],
)
def test_patience_and_retries_end_the_failing_cycles(make_session, retries, patience, calls, outcome):
    session = make_session(controller_max_retries=retries, controller_patience=patience)
    session.controller.play(FAILS)
    result = session.navigator.exe_path(session.path_to(5.0))
    assert len(session.controller.requests) == calls
    assert result.outcome == outcome
    assert result.plugin_outcome == Outcome.BLOCKED_PATH


def test_a_good_cycle_begins_the_count_of_failures_and_patience_anew(make_session):
    session = make_session(controller_max_retries=2, controller_patience=0.12)
    session.controller.play(FAILS, FAILS, drive(), FAILS, FAILS, drive(), FAILS)
    assert session.navigator.exe_path(session.path_to(50.0)).outcome in (Outcome.BLOCKED_PATH, Outcome.PAT_EXCEEDED)
    assert len(session.controller.requests) == 9


def test_a_call_that_outlasts_patience_ends_the_goal_also_if_it_returns_a_command(make_session):
    session = make_session(controller_patience=0.5, cancel_grace=1.0)
    session.controller.play(drive(), slow(session.clock, 1.0, drive(2.0)), drive(2.0))
    result = session.navigator.exe_path(session.path_to(50.0))
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert all(command.vx < 2.0 for _, command in session.robot.commands)


def test_without_a_patience_limit_a_slow_controller_is_waited_for(make_session):
    session = make_session(controller_patience=0.0)
    session.controller.play(slow(session.clock, 20.0, drive()), session.controller.follow)
    assert session.navigator.exe_path(session.path_to(1.0)).success


# ------------------------------------------------------------------------------------------------- commands
@pytest.mark.parametrize("bad", [nan_command, no_command])
def test_a_success_without_a_usable_command_counts_as_no_valid_command(make_session, bad):
    session = make_session(controller_max_retries=0)
    session.controller.play(drive(), bad)
    assert session.navigator.exe_path(session.path_to(5.0)).outcome == Outcome.NO_VALID_CMD


@pytest.mark.parametrize(("force_stop", "speed"), [(True, 0.0), (False, 0.1)])
def test_force_stop_on_retry_decides_what_a_failed_cycle_sends(make_session, force_stop, speed):
    session = make_session(force_stop_on_retry=force_stop, controller_max_retries=-1)
    session.controller.play(drive(0.5), FAILS_BUT_DRIVES)
    handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
    session.clock.sleep(0.52)
    assert session.robot.command.vx == speed
    assert handle.feedback.last_command.vx == 0.1  # what the plugin computed
    assert (handle.feedback.outcome, handle.feedback.message) == (Outcome.BLOCKED_PATH, "a chair")
    handle.cancel()
    handle.wait()


def test_a_car_gets_ackermann_commands(make_session):
    session = make_session()
    session.controller.play(ControlResult(0, "", AckermannCommand(0.5, 0.2)))
    handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
    session.clock.sleep(1.0)
    handle.cancel()
    handle.wait()
    assert session.robot.command == AckermannCommand(0.0, 0.2)
    assert session.robot.pose.yaw > 0.1


def test_a_controller_that_cancels_by_itself_ends_the_goal_canceled(make_session):
    session = make_session()
    session.controller.play(drive(), ControlResult(Outcome.CANCELED, "I give up", Twist.planar(1.0)))
    handle = session.navigator.send(ExePathGoal(session.path_to(5.0)))
    result = handle.wait()
    assert (handle.status, result.outcome, result.message) == (GoalStatus.CANCELED, Outcome.CANCELED, "I give up")
    assert all(command.vx <= 0.5 for _, command in session.robot.commands)


def test_the_loop_keeps_its_rate(make_session):
    session = make_session(controller_frequency=10.0)
    stamps = []

    def stamp(request):
        stamps.append(round(session.clock.now(), 6))
        session.clock.sleep(0.03)
        return drive()

    session.controller.play(stamp)
    handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
    session.clock.sleep(1.05)
    assert stamps == [round(0.1 * i, 6) for i in range(11)]
    session.server.set_parameters(controller_frequency=50.0)
    session.clock.sleep(1.0)
    handle.cancel()
    handle.wait()
    assert 30 <= len(stamps) - 11 <= 36  # 0.03 s of work in periods of 0.02 s


def test_an_over_run_drops_the_missed_cycles(make_session):
    session = make_session(command_timeout=5.0)
    stamps = []

    def stamp(request):
        stamps.append(round(session.clock.now(), 6))
        session.clock.sleep(0.37 if len(stamps) == 1 else 0.0)
        return drive()

    session.controller.play(stamp)
    handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
    session.clock.sleep(0.5)
    handle.cancel()
    handle.wait()
    assert stamps[:4] == [0.0, 0.37, 0.42, 0.47]


# ------------------------------------------------------------------------------- stale pose, map, odometry
def test_a_stale_pose_holds_the_robot_until_it_is_fresh_again(make_session, states):
    session = make_session(tf_timeout=0.3, controller_patience=5.0)
    handle = session.navigator.send(ExePathGoal(session.path_to(3.0)))
    session.clock.sleep(1.0)
    session.robot.publishes_pose = False
    session.clock.sleep(1.0)
    assert session.robot.command == Twist()
    assert end_state(states, session) == "holding"
    calls = len(session.controller.requests)
    session.clock.sleep(1.0)
    assert len(session.controller.requests) == calls
    session.robot.publishes_pose = True
    assert handle.wait().success


def test_a_map_problem_holds_the_robot_and_ends_in_map_error_after_patience(make_session):
    session = make_session(controller_patience=2.0)
    handle = session.navigator.send(ExePathGoal(session.path_to(9.0)))
    session.clock.sleep(1.0)
    session.server.map_trouble = "the laser is silent for 1.3 s"
    session.clock.sleep(0.1)
    assert session.robot.command == Twist()
    session.server.map_trouble = ""
    session.clock.sleep(1.0)
    assert not session.robot.command.is_stopped()
    session.server.map_trouble = "the laser is silent for 1.3 s"
    result = handle.wait()
    assert (result.outcome, result.message) == (Outcome.MAP_ERROR, "the laser is silent for 1.3 s")
    assert session.clock.now() == pytest.approx(4.1, abs=0.1)


def test_stale_odometry_holds_and_then_names_its_age(make_session):
    session = make_session(tf_timeout=0.5, controller_patience=1.0)
    handle = session.navigator.send(ExePathGoal(session.path_to(9.0)))
    session.clock.sleep(1.0)
    session.robot.publishes_odometry = False
    result = handle.wait()
    assert result.outcome == Outcome.TF_ERROR
    assert "odometry is" in result.message
