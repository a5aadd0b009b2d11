"""move_base: planning and following, tolerances, order and resets of recovery, oscillation."""

from dataclasses import replace

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.arrival_tolerance import planned_tolerance
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.plugins import ControlResult, RecoveryResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan

BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")


def alternate(*answers):
    """Answer in turns, for ever."""
    count = [0]

    def answer(request):
        count[0] += 1
        chosen = answers[(count[0] - 1) % len(answers)]
        return chosen(request) if callable(chosen) else chosen

    return answer


def test_it_plans_follows_and_succeeds(make_session, states):
    session = make_session()
    handle = session.send()
    result = handle.wait()
    assert (handle.status, result.outcome) == (GoalStatus.SUCCEEDED, Outcome.SUCCESS)
    assert result.dist_to_goal < 0.1
    assert result.final_pose.x == pytest.approx(2.0, abs=0.1)
    assert states(session, "move_base") == ["exe_path"]
    assert handle.feedback.dist_to_goal < 0.2
    assert session.recoveries == []


def test_the_goals_tolerances_reach_planner_and_controller(make_session):
    session = make_session()
    result = session.send(dist_tolerance=0.7, angle_tolerance=0.3).wait()
    request = session.planner.requests[0]
    assert (request.dist_tolerance, request.angle_tolerance) == (planned_tolerance(0.7), 0.3)
    assert 0.3 < result.dist_to_goal < 0.75


def test_without_tolerances_of_the_goal_those_of_the_server_reach_the_planner(make_session):
    session = make_session(dist_tolerance=0.4, angle_tolerance=0.5)
    session.send().wait()
    request = session.planner.requests[0]
    assert (request.dist_tolerance, request.angle_tolerance) == (planned_tolerance(0.4), 0.5)


@pytest.mark.parametrize(
    ("short", "message"),
    [(0.05, "goal reached"), (0.4, "goal reached; its path ends 0.40 m from the goal (tolerance 0.10 m)")],
)
def test_a_path_that_ends_farther_off_than_the_tolerance_is_a_success_that_says_so(make_session, short, message):
    session = make_session(dist_tolerance=0.1, plan_end_tolerance=0.5)
    session.planner.play(lambda asked: straight_plan(replace(asked, goal=Pose.planar(2.0 - short, 0.0))))
    result = session.send().wait()
    assert (result.outcome, result.message) == (Outcome.SUCCESS, message)
    assert result.dist_to_goal == pytest.approx(short, abs=0.11)


def test_a_path_as_short_of_the_target_as_the_planner_may_end_it_leads_to_within_the_tolerance(make_session):
    session = make_session(dist_tolerance=0.4)
    session.planner.play(lambda asked: straight_plan(replace(asked, goal=Pose.planar(2.0 - asked.dist_tolerance, 0.0))))
    result = session.send().wait()
    assert result.success
    assert result.final_pose.distance_to(Pose.planar(2.0, 0.0)) <= 0.4


@pytest.mark.parametrize(("off", "farthest"), [(0.1, 0.4), (0.3, 0.4), (0.39, 0.5)])
def test_a_path_that_ends_off_the_target_leaves_less_of_the_tolerance_for_arrival(make_session, off, farthest):
    session = make_session(dist_tolerance=0.4)
    short = Pose.planar(2.0 - off, 0.0)
    session.planner.play(lambda request: straight_plan(replace(request, goal=short)))
    result = session.send().wait()
    assert result.success
    assert result.final_pose.distance_to(Pose.planar(2.0, 0.0)) <= farthest


def test_failed_planning_runs_the_behaviours_in_order_and_ends_with_the_planners_code(make_session):
    session = make_session(retries=0)
    session.planner.play(session.no_path)
    result = session.send().wait()
    assert session.recoveries == ["first", "second", "third"]
    assert session.plans == 4
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "walled in")


def test_failed_control_runs_the_behaviours_in_order_and_ends_with_the_controllers_code(make_session):
    session = make_session(retries=0)
    session.controller.play(BLOCKED)
    result = session.send().wait()
    assert session.recoveries == ["first", "second", "third"]
    assert (result.outcome, result.message) == (ExePathOutcome.BLOCKED_PATH, "a chair")


def test_a_recovery_that_helps_lets_the_goal_succeed(make_session):
    session = make_session(retries=0)
    session.planner.play(session.no_path, straight_plan)
    assert session.send().wait().success
    assert session.recoveries == ["first"]


@pytest.mark.parametrize("answer", [RecoveryResult(RecoveryOutcome.FAILURE, "no"), RuntimeError("broken")])
def test_a_behaviour_that_fails_is_followed_by_planning_and_then_the_next_one(make_session, answer):
    session = make_session(retries=0)
    session.plugin("first", ScriptedRecovery).play(answer)
    session.planner.play(session.no_path, session.no_path, straight_plan)
    assert session.send().wait().success
    assert session.recoveries == ["first", "second"]


def test_a_plan_after_failed_planning_resets_the_list(make_session):
    session = make_session(retries=0)
    session.planner.play(session.no_path, straight_plan)
    session.controller.play(drive(0.3), BLOCKED, session.controller.follow)
    assert session.send().wait().success
    assert session.recoveries == ["first", "first"]


def test_motion_after_failed_control_resets_the_list(make_session):
    session = make_session(retries=0, oscillation_distance=0.5)
    session.controller.play(BLOCKED, *[drive(0.5)] * 30, BLOCKED, session.controller.follow)
    assert session.send(4.0).wait().success
    assert session.recoveries == ["first", "first"]


def test_without_motion_after_failed_control_the_next_behaviour_runs(make_session):
    session = make_session(retries=0, oscillation_distance=0.5)
    session.controller.play(BLOCKED, drive(0.5), BLOCKED, session.controller.follow)
    assert session.send(4.0).wait().success
    assert session.recoveries == ["first", "second"]


@pytest.mark.parametrize(
    ("fields", "parameters", "expected"),
    [
        ({"recovery_behaviors": ("third", "first")}, {}, ["third", "first"]),
        ({"recovery_behaviors": ()}, {}, []),
        ({}, {"recovery_enabled": False}, []),
    ],
)
def test_the_goal_and_the_parameters_say_which_behaviours_run(make_session, fields, parameters, expected):
    session = make_session(retries=0, **parameters)
    session.planner.play(session.no_path)
    assert session.send(**fields).wait().outcome == GetPathOutcome.NO_PATH_FOUND
    assert session.recoveries == expected


def test_a_fatal_failure_of_control_ends_the_goal_without_recovery(make_session):
    session = make_session()
    session.controller.play(RuntimeError("broken"))
    assert session.send().wait().outcome == ExePathOutcome.INTERNAL_ERROR
    assert session.recoveries == []


def test_a_robot_that_gets_nowhere_is_stopped_and_recovered(make_session):
    session = make_session(oscillation_timeout=2.0)
    to_and_fro = [drive(0.3 if i // 5 % 2 else -0.3) for i in range(45)]
    session.controller.play(*to_and_fro, session.controller.follow)
    assert session.send(3.0).wait().success
    assert session.recoveries == ["first"]


def test_a_robot_that_never_gets_anywhere_ends_with_oscillation(make_session):
    session = make_session(oscillation_timeout=2.0)
    session.controller.play(alternate(*[drive(0.3)] * 5, *[drive(-0.3)] * 5))
    result = session.send(3.0).wait()
    assert result.outcome == Outcome.OSCILLATION
    assert session.recoveries == ["first", "second", "third"]
