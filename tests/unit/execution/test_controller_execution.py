"""The controller execution; F-numbers are facts of the upstream tests, with their ids. Every test ends standing."""

import math

import pytest

from mbf_abstract.execution.arrival import ArrivalCheck
from mbf_abstract.execution.controller import ControllerExecution
from mbf_abstract.execution.controller_state import Plan
from mbf_abstract.execution.plugin_run import PluginRun
from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.goals.handle import GoalStatus
from mbf_abstract.outcomes import ExePathOutcome as Outcome
from mbf_abstract.plugins import ControlResult, PluginKind
from mbf_abstract.testing.faulty import drive, nan_command, no_command, slow

FAILS = ControlResult(Outcome.BLOCKED_PATH, "a chair")
FAILS_BUT_DRIVES = ControlResult(Outcome.BLOCKED_PATH, "a chair", Twist.planar(0.1))


def end_state(states, bench):
    return states(bench, "controller_execution")[-1]


def run_execution(bench, plan):
    """Run a controller execution without its action, which would refuse such a plan."""
    handle = bench.navigator.send(ExePathGoal(bench.path_to(1.0)))
    bench.clock.sleep(0.0)
    handle.cancel()
    handle.wait()
    bench.clock.sleep(0.1)
    plugin = bench.server.plugins.get(PluginKind.CONTROLLER, "")
    plans = [plan]
    run = PluginRun(bench.server.runtime, plugin, handle, lambda: 5.0, lambda: None)
    handle.cancel_requested = False
    with run:
        return ControllerExecution(run, lambda: plans.pop() if plans else None, lambda cycle: None).execute()


def test_f277_started_without_a_plan(make_bench):
    end = run_execution(make_bench(), None)
    assert (end.state.value, end.outcome) == ("no_plan", Outcome.INVALID_PATH)


def test_f278_an_empty_plan(make_bench):
    empty = Plan(Path.from_poses([]), ArrivalCheck(Pose.planar(0, 0), 0.1, 0.1))
    end = run_execution(make_bench(), empty)
    assert (end.state.value, end.outcome) == ("empty_plan", Outcome.INVALID_PATH)


def test_f279_a_plan_that_the_plugin_refuses(make_bench, states):
    bench = make_bench()
    bench.controller.accepts_plan = False
    result = bench.navigator.exe_path(bench.path_to(2.0))
    assert end_state(states, bench) == "invalid_plan"
    assert (result.outcome, result.message) == (Outcome.INVALID_PATH, "controller 'controller' refused the path")


def test_f280_without_a_robot_pose_it_holds_and_then_ends(make_bench):
    bench = make_bench(controller_patience=2.0, tf_timeout=0.5)
    bench.robot.publishes_pose = False
    bench.clock.sleep(1.0)
    result = bench.navigator.exe_path(Path.from_points([(0, 0, 0), (1, 0, 0)]))
    assert result.outcome == Outcome.TF_ERROR  # upstream: INTERNAL_ERROR, or TF_ERROR if the action was faster
    assert bench.controller.requests == []
    assert (result.final_pose, result.dist_to_goal) == (None, float("inf"))


def test_f281_the_plugin_says_the_goal_is_reached(make_bench, states):
    bench = make_bench()
    result = bench.navigator.exe_path(Path.from_points([(0, 0, 0), (0.05, 0, 0)]))
    assert result.success
    assert states(bench, "controller_execution") == ["started", "arrived_goal"]
    assert bench.controller.requests == []
    assert result.plugin_outcome is None


def test_f282_a_controller_that_raises_is_an_internal_error(make_bench, states):
    bench = make_bench()
    bench.controller.play(drive(), KeyError("nothing"))
    result = bench.navigator.exe_path(bench.path_to(5.0))
    assert result.outcome == Outcome.INTERNAL_ERROR
    assert "KeyError in compute_velocity_commands" in result.message
    assert end_state(states, bench) == "internal_error"


def test_f283_one_retry_is_one_failed_cycle_and_then_the_end(make_bench, states):
    bench = make_bench(controller_max_retries=1)
    bench.controller.play(FAILS)
    result = bench.navigator.exe_path(bench.path_to(5.0))
    assert states(bench, "controller_execution") == [
        "started",
        "controlling",
        "no_local_cmd",
        "controlling",
        "max_retries",
    ]
    assert (result.outcome, result.message) == (Outcome.BLOCKED_PATH, "a chair")
    assert (result.plugin_outcome, result.plugin_message) == (Outcome.BLOCKED_PATH, "a chair")


def test_f284_unlimited_retries_go_on(make_bench, states):
    bench = make_bench(controller_max_retries=-1)
    bench.controller.play(FAILS)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(5.0)))
    bench.clock.sleep(2.02)
    assert not handle.done
    assert end_state(states, bench) == "no_local_cmd"
    handle.cancel()
    handle.wait()


def test_f285_a_failure_after_patience_is_patience_exceeded(make_bench, states):
    bench = make_bench(controller_patience=1.0)
    bench.controller.play(FAILS)
    result = bench.navigator.exe_path(bench.path_to(5.0))
    assert end_state(states, bench) == "pat_exceeded"
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert result.message == "no valid command for 1 s; the controller said: a chair"
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
def test_patience_and_retries_end_the_failing_cycles(make_bench, retries, patience, calls, outcome):
    bench = make_bench(controller_max_retries=retries, controller_patience=patience)
    bench.controller.play(FAILS)
    result = bench.navigator.exe_path(bench.path_to(5.0))
    assert len(bench.controller.requests) == calls
    assert result.outcome == outcome
    assert result.plugin_outcome == Outcome.BLOCKED_PATH


def test_a_good_cycle_begins_the_count_of_failures_and_patience_anew(make_bench):
    bench = make_bench(controller_max_retries=2, controller_patience=0.12)
    bench.controller.play(FAILS, FAILS, drive(), FAILS, FAILS, drive(), FAILS)
    assert bench.navigator.exe_path(bench.path_to(50.0)).outcome in (Outcome.BLOCKED_PATH, Outcome.PAT_EXCEEDED)
    assert len(bench.controller.requests) == 9


def test_a_call_that_outlasts_patience_ends_the_goal_also_if_it_returns_a_command(make_bench):
    bench = make_bench(controller_patience=0.5, cancel_grace=1.0)
    bench.controller.play(drive(), slow(bench.clock, 1.0, drive(2.0)), drive(2.0))
    result = bench.navigator.exe_path(bench.path_to(50.0))
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert all(command.vx < 2.0 for _, command in bench.robot.commands)


def test_without_a_patience_limit_a_slow_controller_is_waited_for(make_bench):
    bench = make_bench(controller_patience=0.0)
    bench.controller.play(slow(bench.clock, 20.0, drive()), bench.controller.follow)
    assert bench.navigator.exe_path(bench.path_to(1.0)).success


# ------------------------------------------------------------------------------------------------- commands
@pytest.mark.parametrize("bad", [nan_command, no_command])
def test_a_success_without_a_usable_command_counts_as_no_valid_command(make_bench, bad):
    bench = make_bench(controller_max_retries=0)
    bench.controller.play(drive(), bad)
    assert bench.navigator.exe_path(bench.path_to(5.0)).outcome == Outcome.NO_VALID_CMD


@pytest.mark.parametrize(("force_stop", "speed"), [(True, 0.0), (False, 0.1)])
def test_force_stop_on_retry_decides_what_a_failed_cycle_sends(make_bench, force_stop, speed):
    bench = make_bench(force_stop_on_retry=force_stop, controller_max_retries=-1)
    bench.controller.play(drive(0.5), FAILS_BUT_DRIVES)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
    bench.clock.sleep(0.52)
    assert bench.robot.command.vx == speed
    assert handle.feedback.last_command.vx == 0.1  # what the plugin computed
    assert (handle.feedback.outcome, handle.feedback.message) == (Outcome.BLOCKED_PATH, "a chair")
    handle.cancel()
    handle.wait()


def test_a_car_gets_ackermann_commands(make_bench):
    bench = make_bench()
    bench.controller.play(ControlResult(0, "", AckermannCommand(0.5, 0.2)))
    handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
    bench.clock.sleep(1.0)
    handle.cancel()
    handle.wait()
    assert bench.robot.command == AckermannCommand(0.0, 0.2)
    assert bench.robot.pose.yaw > 0.1


def test_a_controller_that_cancels_by_itself_ends_the_goal_canceled(make_bench):
    bench = make_bench()
    bench.controller.play(drive(), ControlResult(Outcome.CANCELED, "I give up", Twist.planar(1.0)))
    handle = bench.navigator.send(ExePathGoal(bench.path_to(5.0)))
    result = handle.wait()
    assert (handle.status, result.outcome, result.message) == (GoalStatus.CANCELED, Outcome.CANCELED, "I give up")
    assert all(command.vx <= 0.5 for _, command in bench.robot.commands)


def test_the_loop_keeps_its_rate(make_bench):
    bench = make_bench(controller_frequency=10.0)
    stamps = []

    def stamp(request):
        stamps.append(round(bench.clock.now(), 6))
        bench.clock.sleep(0.03)
        return drive()

    bench.controller.play(stamp)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
    bench.clock.sleep(1.05)
    assert stamps == [round(0.1 * i, 6) for i in range(11)]
    bench.server.set_parameters(controller_frequency=50.0)
    bench.clock.sleep(1.0)
    handle.cancel()
    handle.wait()
    assert 30 <= len(stamps) - 11 <= 36  # 0.03 s of work in periods of 0.02 s


def test_an_over_run_drops_the_missed_cycles(make_bench):
    bench = make_bench(command_timeout=5.0)
    stamps = []

    def stamp(request):
        stamps.append(round(bench.clock.now(), 6))
        bench.clock.sleep(0.37 if len(stamps) == 1 else 0.0)
        return drive()

    bench.controller.play(stamp)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
    bench.clock.sleep(0.5)
    handle.cancel()
    handle.wait()
    assert stamps[:4] == [0.0, 0.37, 0.42, 0.47]


# ------------------------------------------------------------------------------- stale pose, map, odometry
def test_a_stale_pose_holds_the_robot_until_it_is_fresh_again(make_bench, states):
    bench = make_bench(tf_timeout=0.3, controller_patience=5.0)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(3.0)))
    bench.clock.sleep(1.0)
    bench.robot.publishes_pose = False
    bench.clock.sleep(1.0)
    assert bench.robot.command == Twist()
    assert end_state(states, bench) == "holding"
    calls = len(bench.controller.requests)
    bench.clock.sleep(1.0)
    assert len(bench.controller.requests) == calls
    bench.robot.publishes_pose = True
    assert handle.wait().success


def test_a_map_problem_holds_the_robot_and_ends_in_map_error_after_patience(make_bench):
    bench = make_bench(controller_patience=2.0)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(9.0)))
    bench.clock.sleep(1.0)
    bench.server.map_trouble = "the laser is silent for 1.3 s"
    bench.clock.sleep(0.1)
    assert bench.robot.command == Twist()
    bench.server.map_trouble = ""
    bench.clock.sleep(1.0)
    assert not bench.robot.command.is_stopped()
    bench.server.map_trouble = "the laser is silent for 1.3 s"
    result = handle.wait()
    assert (result.outcome, result.message) == (Outcome.MAP_ERROR, "the laser is silent for 1.3 s")
    assert bench.clock.now() == pytest.approx(4.1, abs=0.1)


def test_stale_odometry_holds_and_then_names_its_age(make_bench):
    bench = make_bench(tf_timeout=0.5, controller_patience=1.0)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(9.0)))
    bench.clock.sleep(1.0)
    bench.robot.publishes_odometry = False
    result = handle.wait()
    assert result.outcome == Outcome.TF_ERROR
    assert "odometry is" in result.message


# ------------------------------------------------------------------------------- stuck and oscillating robots
def test_a_robot_that_ignores_its_commands_is_stuck(make_bench, states):
    bench = make_bench(cmd_vel_ignored_tolerance=2.0)
    bench.robot.stuck = True
    result = bench.navigator.exe_path(bench.path_to(3.0))
    assert result.outcome == Outcome.ROBOT_STUCK
    assert end_state(states, bench) == "robot_disabled"
    assert 2.0 < bench.clock.now() < 2.2


@pytest.mark.parametrize("tolerance", [0.0, -1.0])
def test_a_tolerance_of_zero_or_less_lets_the_robot_ignore_commands_for_ever(make_bench, tolerance):
    bench = make_bench(cmd_vel_ignored_tolerance=tolerance)
    bench.robot.stuck = True
    handle = bench.navigator.send(ExePathGoal(bench.path_to(3.0)))
    bench.clock.sleep(60.0)
    assert not handle.done
    handle.cancel()
    handle.wait()


def tilted_frame(angle):
    """Where odom lies in map once the ground under the robot is steeper than thought."""
    return Transform((0.0, 0.0, 0.0), (math.sin(0.5 * angle), 0.0, 0.0, math.cos(0.5 * angle)), "map", "odom")


def test_a_robot_that_tilts_too_far_stops_before_it_tips_over(make_bench, states):
    bench = make_bench(max_tilt=0.5)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(30.0)))
    bench.clock.sleep(2.0)
    bench.robot.T_map_odom = tilted_frame(0.45)
    bench.clock.sleep(2.0)
    assert not handle.done
    bench.robot.T_map_odom, tilted_at = tilted_frame(0.6), bench.clock.now()
    result = handle.wait()
    assert result.outcome == Outcome.ROBOT_STUCK
    assert "tilts by 34.4 degrees, allowed are 28.6" in result.message
    assert bench.clock.now() - tilted_at < 0.2 and bench.robot.command.is_stopped()
    assert end_state(states, bench) == "robot_disabled"


def test_without_max_tilt_a_robot_may_lean_as_far_as_it_will(make_bench):
    bench = make_bench()
    bench.robot.T_map_odom = tilted_frame(0.6)
    handle = bench.navigator.send(ExePathGoal(bench.path_to(30.0)))
    bench.clock.sleep(2.0)
    assert not handle.done
    handle.cancel()
    handle.wait()


def test_a_robot_without_odometry_is_never_called_stuck(make_bench):
    bench = make_bench(cmd_vel_ignored_tolerance=1.0)
    bench.robot.odometry = lambda: None
    assert bench.navigator.exe_path(bench.path_to(2.0)).success


def test_a_robot_that_moves_without_getting_anywhere_oscillates(make_bench, states):
    bench = make_bench(oscillation_timeout=3.0, oscillation_distance=0.5)
    bench.controller.play(*[drive(0.3 if i // 10 % 2 else -0.3) for i in range(400)])
    result = bench.navigator.exe_path(bench.path_to(30.0))
    assert result.outcome == Outcome.OSCILLATION
    assert "has not moved 0.5 m nor turned 3.14 rad in 3 s" in result.message
    assert end_state(states, bench) == "oscillating"


def test_turning_far_enough_is_progress(make_bench):
    bench = make_bench(oscillation_timeout=3.0, oscillation_angle=1.0)
    bench.controller.play(drive(0.0, 0.5))
    handle = bench.navigator.send(ExePathGoal(bench.path_to(30.0)))
    bench.clock.sleep(20.0)
    assert not handle.done
    handle.cancel()
    handle.wait()
