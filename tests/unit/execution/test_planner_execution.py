"""The planner execution and the get_path action; F-numbers are facts of the upstream tests, with their ids."""

import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.goals.goal_area import DiscArea
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome as Outcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.faulty import empty_path, obedient, slow, wrong_frame_path
from mbf_abstract.testing.scripted import ScriptedPlanner, straight_plan

TARGET = Pose.planar(3.0, 0.0)
NO_PATH = PlanResult(Outcome.NO_PATH_FOUND, "a wall is in the way")


class CancelablePlanner(ScriptedPlanner):
    """Counts the calls of ``cancel``."""

    cancels = 0

    def cancel(self):
        self.cancels += 1
        return True


def end_state(states, session):
    return states(session, "planner_execution")[-1]


def test_f263_a_planner_that_returns_zero_has_found_a_plan(make_session, states):
    session = make_session()
    result = session.navigator.get_path(TARGET)
    assert result.outcome == Outcome.SUCCESS
    assert states(session, "planner_execution") == ["started", "planning", "found_plan"]


def test_f264_a_cancel_while_planning_calls_the_plugins_cancel_once(make_session, states):
    session = make_session({"planner": CancelablePlanner})
    session.planner.play(obedient(session.clock, 3.0, straight_plan, PlanResult(Outcome.CANCELED)))
    handle = session.navigator.send(GetPathGoal(TARGET))
    session.clock.sleep(0.5)
    handle.cancel()
    handle.cancel("again")
    result = handle.wait()
    assert session.planner.cancels == 1
    assert end_state(states, session) == "canceled"
    assert (handle.status, result.outcome) == (GoalStatus.CANCELED, Outcome.CANCELED)
    assert result.message == "canceled by the client"
    assert session.clock.now() < 0.6


def test_f265_five_retries_are_six_calls(make_session, states):
    session = make_session(planner_max_retries=5, planner_patience=100.0)
    session.planner.play(NO_PATH)
    result = session.navigator.get_path(TARGET)
    assert len(session.planner.requests) == 6
    assert end_state(states, session) == "max_retries"
    assert (result.outcome, result.message) == (Outcome.NO_PATH_FOUND, NO_PATH.message)


def test_f266_success_after_five_failures(make_session, states):
    session = make_session(planner_max_retries=5, planner_patience=100.0)
    session.planner.play(*[NO_PATH] * 5, lambda request: PlanResult(1, "hard", straight_plan(request).path))
    result = session.navigator.get_path(TARGET)
    assert end_state(states, session) == "found_plan"
    assert (result.outcome, result.success, result.message) == (1, True, "hard")


@pytest.mark.parametrize("patience", [0.0, 1.0])
def test_f267_without_retries_one_failure_is_the_end(make_session, states, patience):
    session = make_session(planner_max_retries=0, planner_patience=patience)
    session.planner.play(NO_PATH)
    assert session.navigator.get_path(TARGET).outcome == Outcome.NO_PATH_FOUND
    assert len(session.planner.requests) == 1
    assert end_state(states, session) == "no_plan_found"


@pytest.mark.parametrize(("usual", "of_goal", "calls"), [(-1, 0, 1), (0, 2, 3), (3, None, 4)])
def test_a_goal_may_have_its_own_number_of_retries(make_session, usual, of_goal, calls):
    session = make_session(planner_max_retries=usual, planner_patience=5.0)
    session.planner.play(NO_PATH)
    assert session.navigator.get_path(TARGET, max_retries=of_goal).outcome == Outcome.NO_PATH_FOUND
    assert len(session.planner.requests) == calls


@pytest.mark.parametrize(("said", "reported"), [(0.0, 3.0), (7.5, 7.5)])
def test_f268_a_cost_of_zero_becomes_the_paths_length(make_session, said, reported):
    session = make_session()
    path = Path.from_points([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)])
    session.planner.play(PlanResult(0, "", path, said))
    assert session.navigator.get_path(TARGET).cost == pytest.approx(reported)


def test_f269_a_call_that_outlasts_patience_and_fails_is_patience_exceeded(make_session, states):
    session = make_session(planner_patience=0.1, planner_max_retries=0)
    session.planner.play(slow(session.clock, 0.2, NO_PATH))
    result = session.navigator.get_path(TARGET)
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert end_state(states, session) == "pat_exceeded"
    assert (result.plugin_outcome, result.plugin_message) == (Outcome.NO_PATH_FOUND, NO_PATH.message)


def test_a_plan_that_comes_late_but_within_the_grace_still_counts(make_session):
    session = make_session(planner_patience=0.1, planner_max_retries=0, cancel_grace=1.0)
    session.planner.play(slow(session.clock, 0.2, straight_plan))
    assert session.navigator.get_path(TARGET).success


def test_f270_unlimited_retries_go_on_until_patience_ends(make_session, states):
    session = make_session(planner_patience=0.5, planner_max_retries=-1)
    session.planner.play(NO_PATH)
    result = session.navigator.get_path(TARGET)
    assert len(session.planner.requests) >= 10
    assert end_state(states, session) == "pat_exceeded"
    assert result.outcome == Outcome.PAT_EXCEEDED
    assert 0.5 <= session.clock.now() <= 0.6


def test_f271_a_planner_that_raises_is_an_internal_error(make_session, states):
    session = make_session()
    session.planner.play(ValueError("no such cell"))
    result = session.navigator.get_path(TARGET)
    assert end_state(states, session) == "internal_error"
    assert result.outcome == Outcome.INTERNAL_ERROR
    assert result.message == "plugin 'planner' raised ValueError in make_plan: no such cell"


# --------------------------------------------------------------------- the patience x retries table (mbf.md 4.2)
@pytest.mark.parametrize(
    ("retries", "patience", "calls", "outcome"),
    [
        (0, 0.0, 1, Outcome.NO_PATH_FOUND),
        (0, 9.0, 1, Outcome.NO_PATH_FOUND),
        (0, 0.5, 1, Outcome.PAT_EXCEEDED),  # the call takes a second
        (3, 0.0, 4, Outcome.NO_PATH_FOUND),
        (3, 9.0, 4, Outcome.NO_PATH_FOUND),
        (3, 2.5, 3, Outcome.PAT_EXCEEDED),
        (3, 3.5, 4, Outcome.NO_PATH_FOUND),  # both at once: retries are tested first
        (-1, 4.5, 5, Outcome.PAT_EXCEEDED),
    ],
)
def test_patience_and_retries_end_the_attempts(make_session, retries, patience, calls, outcome):
    session = make_session(planner_max_retries=retries, planner_patience=patience, planner_retry_delay=1e-3)
    session.planner.play(slow(session.clock, 1.0, NO_PATH))
    result = session.navigator.get_path(TARGET)
    assert len(session.planner.requests) == calls
    assert result.outcome == outcome
    assert (result.plugin_outcome, result.plugin_message) == (Outcome.NO_PATH_FOUND, NO_PATH.message)


def test_unlimited_retries_without_patience_go_on_until_canceled(make_session):
    session = make_session(planner_max_retries=-1, planner_patience=0.0)
    session.planner.play(slow(session.clock, 0.1, NO_PATH))
    handle = session.navigator.send(GetPathGoal(TARGET))
    session.clock.sleep(100.0)
    assert not handle.done
    assert len(session.planner.requests) > 800
    handle.cancel()
    assert handle.wait().outcome == Outcome.CANCELED


def test_a_failing_planner_is_not_called_in_a_busy_loop(make_session):
    session = make_session(planner_max_retries=-1, planner_patience=1.0, planner_retry_delay=0.25)
    session.planner.play(NO_PATH)
    session.navigator.get_path(TARGET)
    assert len(session.planner.requests) == 5


def test_a_call_that_hangs_after_failed_ones_is_given_up_within_patience_and_grace(make_session):
    session = make_session(planner_patience=1.0, cancel_grace=0.5, planner_retry_delay=0.3)
    session.planner.play(NO_PATH, NO_PATH, NO_PATH, slow(session.clock, 50.0, NO_PATH))
    assert session.navigator.get_path(TARGET).outcome == Outcome.PAT_EXCEEDED
    assert session.clock.now() <= 1.6
    session.clock.sleep(60.0)


def test_patience_and_retries_changed_at_run_time_count_for_running_goals(make_session):
    session = make_session(planner_max_retries=-1, planner_patience=0.0)
    session.planner.play(NO_PATH)
    handle = session.navigator.send(GetPathGoal(TARGET))
    session.clock.sleep(2.0)
    session.server.set_parameters(planner_patience=0.5)
    assert handle.wait(1.0).outcome == Outcome.PAT_EXCEEDED


# --------------------------------------------------------------------------------------------- planner action
def test_f272_success_without_poses_is_an_empty_path(make_session):
    session = make_session()
    session.planner.play(empty_path)
    handle = session.navigator.send(GetPathGoal(TARGET))
    assert handle.wait().outcome == Outcome.EMPTY_PATH
    assert handle.status is GoalStatus.ABORTED


def test_f273_a_path_in_the_global_frame_is_a_success_twice_in_a_row(make_session):
    session = make_session()
    for _ in range(2):
        handle = session.navigator.send(GetPathGoal(TARGET))
        result = handle.wait()
        assert handle.status is GoalStatus.SUCCEEDED
        assert result.path[0].distance_to(session.robot.pose) == 0.0
        assert result.path[-1].distance_to(TARGET) == 0.0
        assert (result.planner, result.path.frame_id) == ("planner", "map")


def test_f274_a_path_in_an_unknown_frame_is_a_transform_error(make_session):
    session = make_session()
    session.planner.play(wrong_frame_path)
    result = session.navigator.get_path(TARGET)
    assert result.outcome == Outcome.TF_ERROR
    assert "nowhere" in result.message


def test_f275_without_start_and_robot_pose_the_planner_is_not_even_called(make_session):
    session = make_session()
    session.transforms.clear()
    session.robot.publishes_pose = False
    assert session.navigator.get_path(TARGET).outcome == Outcome.TF_ERROR
    assert session.planner.requests == []
    assert session.navigator.get_path(TARGET, start_pose=Pose.planar(0.0, 0.0)).success


def test_f276_the_planners_own_code_is_the_outcome(make_session):
    session = make_session(planner_max_retries=0)
    session.planner.play(NO_PATH)
    handle = session.navigator.send(GetPathGoal(TARGET))
    assert handle.wait().outcome == Outcome.NO_PATH_FOUND
    assert handle.status is GoalStatus.ABORTED


def test_the_planner_sees_every_field_of_the_goal(make_session):
    session = make_session()
    via = (Pose.planar(1.0, 1.0),)
    session.navigator.get_path(TARGET, dist_tolerance=0.5, angle_tolerance=0.2, via=via, start_pose=Pose.planar(1, 2))
    request = session.planner.requests[0]
    assert (request.start, request.goal, request.via) == (Pose.planar(1, 2), TARGET, via)
    assert (request.dist_tolerance, request.angle_tolerance) == (0.5, 0.2)


def test_tolerances_a_goal_does_not_give_are_those_of_the_server_and_0_is_exact(make_session):
    session = make_session(dist_tolerance=0.4, angle_tolerance=0.3)
    session.navigator.get_path(TARGET)
    session.navigator.get_path(TARGET, dist_tolerance=0.0, angle_tolerance=0.0)
    session.navigator.get_path(TARGET, goal_area=DiscArea(TARGET, 1.0))
    seen = [(request.dist_tolerance, request.angle_tolerance) for request in session.planner.requests]
    assert seen[:3] == [(0.4, 0.3), (0.0, 0.0), (0.0, 0.0)]


@pytest.mark.parametrize(
    ("fields", "outcome", "words"),
    [
        ({"planner": "nobody"}, Outcome.INVALID_PLUGIN, "no planner named 'nobody'; loaded: planner"),
        ({"dist_tolerance": -1.0}, Outcome.INVALID_GOAL, "must not be negative"),
        ({"dist_tolerance": float("nan")}, Outcome.INVALID_GOAL, "must not be negative, got nan m"),
        ({"angle_tolerance": float("nan")}, Outcome.INVALID_GOAL, "must not be negative"),
        ({"dist_tolerance": 1e30}, Outcome.INVALID_GOAL, "dist_tolerance must be at most 1000 m (inf = anywhere)"),
        ({"angle_tolerance": 360.0}, Outcome.INVALID_GOAL, "angle_tolerance must be at most 6.28 rad, got 360"),
        ({"concurrency_slot": 256}, Outcome.INTERNAL_ERROR, "0..255"),
    ],
)
def test_a_goal_that_can_not_be_served_is_rejected_with_the_reason(make_session, fields, outcome, words):
    session = make_session()
    handle = session.navigator.send(GetPathGoal(TARGET, **fields))
    assert handle.status is GoalStatus.REJECTED
    assert handle.result.outcome == outcome
    assert words in handle.result.message


def test_a_planner_that_returns_no_plan_result_is_an_internal_error(make_session):
    session = make_session()
    session.planner.play("a path, honestly")
    result = session.navigator.get_path(TARGET)
    assert result.outcome == Outcome.INTERNAL_ERROR
    assert "returned str from make_plan, not PlanResult" in result.message


def test_two_goals_share_an_instance_one_after_the_other(make_session):
    session = make_session()
    running = [0, 0]

    def plan(request):
        running[0] += 1
        running[1] = max(running)
        session.clock.sleep(0.5)
        running[0] -= 1
        return straight_plan(request)

    session.planner.play(plan)
    handles = [session.navigator.send(GetPathGoal(TARGET, concurrency_slot=slot)) for slot in range(3)]
    assert all(handle.wait().success for handle in handles)
    assert running[1] == 1
    assert session.clock.now() >= 1.5


def test_a_goal_whose_patience_ends_while_it_waits_for_the_instance_says_so(make_session):
    session = make_session(planner_patience=1.0, cancel_grace=10.0)
    session.planner.play(slow(session.clock, 5.0, straight_plan))
    first = session.navigator.send(GetPathGoal(TARGET))
    session.clock.sleep(0.1)
    second = session.navigator.send(GetPathGoal(TARGET, concurrency_slot=1))
    assert second.wait().outcome == Outcome.PAT_EXCEEDED
    assert session.clock.now() < 1.2
    assert len(session.planner.requests) == 1
    assert first.wait().success


@pytest.mark.parametrize(("begin", "end", "accepted"), [(0.4, 0.4, True), (0.6, 0.0, False), (0.0, 0.6, False)])
def test_ends_of_a_plan_may_be_off_by_the_tolerance_of_the_server_and_no_more(make_session, begin, end, accepted):
    session = make_session(plan_end_tolerance=0.5, dist_tolerance=0.0)
    session.planner.play(PlanResult(0, "", Path.from_points([(begin, 0, 0), (3.0 - end, 0, 0)])))
    result = session.navigator.get_path(TARGET)
    assert result.success is accepted
    assert accepted or ("allowed 0.50 m" in result.message and result.outcome == Outcome.INTERNAL_ERROR)
