"""move_base: order and resets of recovery, replanning, oscillation, goals that supersede, cancel and pause anywhere."""

from dataclasses import replace

import pytest

from mbf_abstract.actions.goals import MoveBaseGoal
from mbf_abstract.actions.handle import GoalStatus
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.faulty import drive, obedient, slow
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRecovery, straight_plan

NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")
PLUGINS = {
    "planner": ScriptedPlanner,
    "controller": ScriptedController,
    "first": ScriptedRecovery,
    "second": ScriptedRecovery,
    "third": ScriptedRecovery,
}
ONCE = {"planner_max_retries": 0, "controller_max_retries": 0}


@pytest.fixture
def make_bench(make_bench):
    return lambda **parameters: make_bench(PLUGINS, **parameters)


def send(bench, x=2.0, y=0.0, **fields):
    return bench.navigator.send(MoveBaseGoal(Pose.planar(x, y), **fields))


def recoveries(bench):
    return [event.data["plugin"] for event in bench.events(EventKind.RECOVERY)]


def plans(bench):
    return len(bench.planner.requests)


def alternate(*answers):
    """Answer in turns, for ever."""
    count = [0]

    def answer(request):
        count[0] += 1
        chosen = answers[(count[0] - 1) % len(answers)]
        return chosen(request) if callable(chosen) else chosen

    return answer


def test_it_plans_follows_and_succeeds(make_bench, states):
    bench = make_bench()
    handle = send(bench)
    result = handle.wait()
    assert (handle.status, result.outcome) == (GoalStatus.SUCCEEDED, Outcome.SUCCESS)
    assert result.dist_to_goal < 0.1
    assert result.final_pose.x == pytest.approx(2.0, abs=0.1)
    assert states(bench, "move_base") == ["exe_path"]
    assert handle.feedback.dist_to_goal < 0.2
    assert recoveries(bench) == []


def test_the_goals_tolerances_reach_planner_and_controller(make_bench):
    bench = make_bench()
    result = send(bench, dist_tolerance=0.7, angle_tolerance=0.3).wait()
    request = bench.planner.requests[0]
    assert (request.dist_tolerance, request.angle_tolerance) == (0.7, 0.3)
    assert 0.3 < result.dist_to_goal < 0.75


def test_without_tolerances_of_the_goal_those_of_the_server_reach_the_planner(make_bench):
    bench = make_bench(dist_tolerance=0.4, angle_tolerance=0.5)
    send(bench).wait()
    request = bench.planner.requests[0]
    assert (request.dist_tolerance, request.angle_tolerance) == (0.4, 0.5)


@pytest.mark.parametrize(("off", "farthest"), [(0.1, 0.4), (0.3, 0.4), (0.39, 0.5)])
def test_a_path_that_ends_off_the_target_leaves_less_of_the_tolerance_for_arrival(make_bench, off, farthest):
    bench = make_bench(dist_tolerance=0.4)
    short = Pose.planar(2.0 - off, 0.0)
    bench.planner.play(lambda request: straight_plan(replace(request, goal=short)))
    result = send(bench).wait()
    assert result.success
    assert result.final_pose.distance_to(Pose.planar(2.0, 0.0)) <= farthest


# -------------------------------------------------------------------------------------------------- recovery
def test_failed_planning_runs_the_behaviours_in_order_and_ends_with_the_planners_code(make_bench):
    bench = make_bench(**ONCE)
    bench.planner.play(NO_PATH)
    result = send(bench).wait()
    assert recoveries(bench) == ["first", "second", "third"]
    assert plans(bench) == 4
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "walled in")


def test_failed_control_runs_the_behaviours_in_order_and_ends_with_the_controllers_code(make_bench):
    bench = make_bench(**ONCE)
    bench.controller.play(BLOCKED)
    result = send(bench).wait()
    assert recoveries(bench) == ["first", "second", "third"]
    assert (result.outcome, result.message) == (ExePathOutcome.BLOCKED_PATH, "a chair")


def test_a_recovery_that_helps_lets_the_goal_succeed(make_bench):
    bench = make_bench(**ONCE)
    bench.planner.play(NO_PATH, straight_plan)
    assert send(bench).wait().success
    assert recoveries(bench) == ["first"]


@pytest.mark.parametrize("answer", [RecoveryResult(RecoveryOutcome.FAILURE, "no"), RuntimeError("broken")])
def test_a_behaviour_that_fails_is_followed_by_planning_and_then_the_next_one(make_bench, answer):
    bench = make_bench(**ONCE)
    bench.plugin("first", ScriptedRecovery).play(answer)
    bench.planner.play(NO_PATH, NO_PATH, straight_plan)
    assert send(bench).wait().success
    assert recoveries(bench) == ["first", "second"]


def test_a_plan_after_failed_planning_resets_the_list(make_bench):
    bench = make_bench(**ONCE)
    bench.planner.play(NO_PATH, straight_plan)
    bench.controller.play(drive(0.3), BLOCKED, bench.controller.follow)
    assert send(bench).wait().success
    assert recoveries(bench) == ["first", "first"]


def test_motion_after_failed_control_resets_the_list(make_bench):
    bench = make_bench(oscillation_distance=0.5, **ONCE)
    bench.controller.play(BLOCKED, *[drive(0.5)] * 30, BLOCKED, bench.controller.follow)
    assert send(bench, 4.0).wait().success
    assert recoveries(bench) == ["first", "first"]


def test_without_motion_after_failed_control_the_next_behaviour_runs(make_bench):
    bench = make_bench(oscillation_distance=0.5, **ONCE)
    bench.controller.play(BLOCKED, drive(0.5), BLOCKED, bench.controller.follow)
    assert send(bench, 4.0).wait().success
    assert recoveries(bench) == ["first", "second"]


@pytest.mark.parametrize(
    ("fields", "parameters", "expected"),
    [
        ({"recovery_behaviors": ("third", "first")}, {}, ["third", "first"]),
        ({"recovery_behaviors": ()}, {}, []),
        ({}, {"recovery_enabled": False}, []),
    ],
)
def test_the_goal_and_the_parameters_say_which_behaviours_run(make_bench, fields, parameters, expected):
    bench = make_bench(**ONCE, **parameters)
    bench.planner.play(NO_PATH)
    assert send(bench, **fields).wait().outcome == GetPathOutcome.NO_PATH_FOUND
    assert recoveries(bench) == expected


def test_a_fatal_failure_of_control_ends_the_goal_without_recovery(make_bench):
    bench = make_bench()
    bench.controller.play(RuntimeError("broken"))
    assert send(bench).wait().outcome == ExePathOutcome.INTERNAL_ERROR
    assert recoveries(bench) == []


# ------------------------------------------------------------------------------------------------ replanning
def test_replanning_swaps_the_path_without_stopping(make_bench):
    bench = make_bench(planner_frequency=2.0)
    assert send(bench, 3.0).wait().success
    assert plans(bench) > 8
    begin, end = bench.robot.commands[0][0], bench.clock.now() - 1.5
    assert not [1 for stamp, command in bench.robot.commands if begin < stamp < end and command.is_stopped()]
    assert len(bench.events(EventKind.LEASE_GRANTED)) == 1


def test_without_a_frequency_nothing_is_planned_anew(make_bench):
    bench = make_bench(planner_frequency=0.0)
    send(bench).wait()
    assert plans(bench) == 1


def _fails_after_the_first_plan(bench):
    bench.planner.play(straight_plan, NO_PATH)
    return send(bench, 3.0)


def test_policy_keep_drives_on_with_the_old_path(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="keep", **ONCE)
    assert _fails_after_the_first_plan(bench).wait().success
    assert plans(bench) > 5


def test_policy_stop_ends_the_goal_standing(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="stop", **ONCE)
    result = _fails_after_the_first_plan(bench).wait()
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "replanning failed: walled in")
    assert bench.robot.command == Twist()
    assert recoveries(bench) == []


def test_policy_recover_stops_recovers_and_plans_anew(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="recover", **ONCE)
    bench.planner.play(straight_plan, NO_PATH, straight_plan)
    assert send(bench, 3.0).wait().success
    assert recoveries(bench) == ["first"]


def test_a_replanning_under_way_at_the_goal_is_canceled(make_bench):
    bench = make_bench(planner_frequency=1.0)
    canceled = PlanResult(GetPathOutcome.CANCELED, "as told")
    bench.planner.play(straight_plan, obedient(bench.clock, 4.0, straight_plan, canceled))
    assert send(bench, 1.0).wait().success
    bench.clock.sleep(0.1)
    assert not bench.server.get_path.busy


# ----------------------------------------------------------------------------------------------- oscillation
def test_a_robot_that_gets_nowhere_is_stopped_and_recovered(make_bench):
    bench = make_bench(oscillation_timeout=2.0)
    to_and_fro = [drive(0.3 if i // 5 % 2 else -0.3) for i in range(45)]
    bench.controller.play(*to_and_fro, bench.controller.follow)
    assert send(bench, 3.0).wait().success
    assert recoveries(bench) == ["first"]


def test_a_robot_that_never_gets_anywhere_ends_with_oscillation(make_bench):
    bench = make_bench(oscillation_timeout=2.0)
    bench.controller.play(alternate(*[drive(0.3)] * 5, *[drive(-0.3)] * 5))
    result = send(bench, 3.0).wait()
    assert result.outcome == Outcome.OSCILLATION
    assert recoveries(bench) == ["first", "second", "third"]


# --------------------------------------------------------------------------------------------- superseding
def test_a_newer_goal_takes_over_while_the_robot_drives_on(make_bench):
    bench = make_bench()
    bench.planner.play(straight_plan, slow(bench.clock, 0.5, straight_plan))
    first = send(bench, 5.0)
    bench.clock.sleep(1.0)
    second = send(bench, 3.0, 2.0)
    bench.clock.sleep(0.3)
    assert (first.status, first.result.outcome) == (GoalStatus.CANCELED, Outcome.CANCELED)
    assert first.result.message == "preempted by a new goal"
    assert not bench.robot.command.is_stopped()
    result = second.wait()
    assert result.success
    assert bench.robot.pose.distance_to(Pose.planar(3.0, 2.0)) < 0.15
    assert len(bench.events(EventKind.LEASE_GRANTED)) == 1


def test_arriving_at_the_old_goal_while_the_new_plan_is_made_is_no_success_of_the_new_one(make_bench):
    bench = make_bench()
    bench.planner.play(straight_plan, slow(bench.clock, 3.0, straight_plan))
    send(bench, 1.0)
    bench.clock.sleep(1.5)
    second = send(bench, 1.0, 2.0)
    assert second.wait().success
    assert bench.robot.pose.distance_to(Pose.planar(1.0, 2.0)) < 0.15


def test_a_failed_plan_for_the_new_goal_stops_the_robot_and_recovers(make_bench):
    bench = make_bench(**ONCE)
    bench.planner.play(straight_plan, NO_PATH, straight_plan)
    send(bench, 5.0)
    bench.clock.sleep(1.0)
    assert send(bench, 3.0).wait().success
    assert recoveries(bench) == ["first"]


def test_a_newer_goal_during_recovery_is_planned_for_afterwards(make_bench):
    bench = make_bench(**ONCE)
    bench.planner.play(NO_PATH, straight_plan)
    bench.plugin("first", ScriptedRecovery).play(slow(bench.clock, 2.0, RecoveryResult(0, "waited")))
    first = send(bench, 5.0)
    bench.clock.sleep(1.0)
    second = send(bench, 1.0)
    assert second.wait().success
    assert first.status is GoalStatus.CANCELED
    assert [request.goal.x for request in bench.planner.requests] == [5.0, 1.0]


def test_a_newer_goal_while_the_robot_stops_is_planned_for_without_the_old_recovery(make_bench):
    bench = make_bench(planner_frequency=2.0, replan_failed_policy="recover", **ONCE)
    bench.controller.stops_itself = True  # takes five cycles
    bench.planner.play(straight_plan, NO_PATH, straight_plan)
    send(bench, 5.0)
    bench.clock.sleep(0.6)
    second = send(bench, 1.0)
    assert second.wait().success
    assert recoveries(bench) == []


def test_a_newer_goal_in_an_unknown_frame_stops_the_robot(make_bench):
    bench = make_bench()
    first = send(bench, 5.0)
    bench.clock.sleep(1.0)
    second = bench.navigator.send(MoveBaseGoal(Pose.planar(1.0, 0.0, frame_id="mars")))
    result = second.wait()
    assert result.outcome == Outcome.TF_ERROR
    assert "mars" in result.message
    assert first.status is GoalStatus.CANCELED
    assert bench.robot.command == Twist()


def test_many_goals_at_once_leave_only_the_newest(make_bench):
    bench = make_bench()
    handles = [send(bench, float(x)) for x in range(1, 6)]
    bench.clock.sleep(0.5)
    handles += [send(bench, 0.5), send(bench, 1.0)]
    assert handles[-1].wait().success
    assert {handle.status for handle in handles[:-1]} == {GoalStatus.CANCELED}


# ---------------------------------------------------------------------------------------------- cancel, pause
def _planning(bench):
    canceled = PlanResult(GetPathOutcome.CANCELED, "as told")
    bench.planner.play(obedient(bench.clock, 4.0, straight_plan, canceled))


def _following(bench):
    pass


def _recovering(bench):
    bench.planner.play(NO_PATH)
    bench.plugin("first", ScriptedRecovery).play(
        lambda request: RecoveryResult(0 if request.motion.sleep(9.0) else RecoveryOutcome.CANCELED, "")
    )


@pytest.mark.parametrize("begin", [_planning, _following, _recovering])
def test_a_cancel_ends_the_goal_and_its_parts_in_every_state(make_bench, begin):
    bench = make_bench(**ONCE)
    begin(bench)
    handle = send(bench, 5.0)
    bench.clock.sleep(1.0)
    handle.cancel("enough")
    result = handle.wait()
    assert (handle.status, result.outcome, result.message) == (GoalStatus.CANCELED, Outcome.CANCELED, "enough")
    assert bench.clock.now() < 1.1
    assert bench.robot.command == Twist()
    server = bench.server
    bench.clock.sleep(0.1)
    assert not any(action.busy for action in (server.get_path, server.exe_path, server.recovery, server.move_base))


def test_a_cancel_in_the_instant_the_plan_is_there_is_not_lost(make_bench):
    bench = make_bench()
    handle = send(bench, 5.0)

    def plan_and_cancel(request):
        handle.cancel()
        return straight_plan(request)

    bench.planner.play(plan_and_cancel)
    assert handle.wait().outcome == Outcome.CANCELED
    bench.clock.sleep(1.0)
    assert not bench.robot.moved_after(-1.0)


@pytest.mark.parametrize("begin", [_planning, _following, _recovering])
def test_a_pause_holds_the_robot_in_every_state_and_the_goal_goes_on_after_it(make_bench, begin):
    bench = make_bench(oscillation_timeout=5.0, **ONCE)
    begin(bench)
    handle = send(bench, 2.0)
    bench.clock.sleep(1.0)
    handle.pause()
    bench.clock.sleep(0.1)
    where = bench.robot.pose.x
    bench.clock.sleep(30.0)
    assert handle.status is GoalStatus.PAUSED
    assert bench.robot.pose.x == where
    bench.planner.play(straight_plan)
    handle.resume()
    assert handle.wait().success


# ------------------------------------------------------------------------------------------- rejection, errors
@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"planner": "x"}, "no planner named 'x'"),
        ({"controller": "x"}, "no controller named 'x'"),
        ({"recovery_behaviors": ("first", "x")}, "no recovery behavior named 'x'"),
        ({"dist_tolerance": 0.0}, "dist_tolerance must be positive"),
        ({"angle_tolerance": -1.0}, "angle_tolerance must be positive"),
    ],
)
def test_a_goal_that_can_not_be_served_is_rejected_with_the_reason(make_bench, fields, words):
    bench = make_bench()
    handle = send(bench, **fields)
    assert handle.status is GoalStatus.REJECTED
    assert handle.result.outcome == Outcome.FAILURE
    assert words in handle.result.message


def test_without_a_robot_pose_the_goal_is_a_transform_error(make_bench):
    bench = make_bench()
    bench.robot.publishes_pose = False
    bench.transforms.clear()
    result = send(bench).wait()
    assert (result.outcome, result.final_pose) == (Outcome.TF_ERROR, None)


def test_a_target_in_an_unknown_frame_is_a_transform_error(make_bench):
    bench = make_bench()
    result = bench.navigator.go_to(Pose.planar(1.0, 0.0, frame_id="mars"))
    assert result.outcome == Outcome.TF_ERROR
