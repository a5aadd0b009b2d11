"""A second planner plans where the first one finds no path."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal, MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, straight_plan

THERE = Pose.planar(2.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "a wall")
BLOCKED = [
    NO_PATH,
    PlanResult(GetPathOutcome.BLOCKED_START, "the start is blocked"),
    PlanResult(GetPathOutcome.BLOCKED_GOAL, "the goal is blocked"),
]


@pytest.fixture
def make_pair(make_session):
    """Make sessions with the planners ``planner`` and ``careful``, the second of which is the fallback."""

    def make(**parameters):
        plugins = {"planner": ScriptedPlanner, "careful": ScriptedPlanner, "controller": ScriptedController}
        session = make_session(plugins, fallback_planner="careful", **parameters)
        session.careful = session.plugin("careful", ScriptedPlanner)
        return session

    return make


@pytest.mark.parametrize("answer", BLOCKED, ids=lambda answer: answer.message)
@pytest.mark.parametrize("retries", [-1, 0, 5])
def test_where_the_first_finds_no_path_the_second_plans(make_pair, answer, retries):
    session = make_pair(planner_max_retries=retries)
    session.planner.play(answer)
    result = session.navigator.send(GetPathGoal(THERE)).wait()
    assert result.success and result.planner == "careful" and result.path is not None
    assert result.message.endswith(f"before, planner: {answer.message}")
    assert (len(session.planner.requests), len(session.careful.requests)) == (1, 1)
    assert session.clock.now() == 0.0


def test_a_path_of_the_first_needs_no_second(make_pair):
    session = make_pair()
    assert session.navigator.send(GetPathGoal(THERE)).wait().planner == "planner"
    assert not session.careful.requests


def test_a_failure_that_no_planner_can_change_is_not_tried_by_the_second(make_pair):
    session = make_pair()
    session.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "an island", permanent=True))
    result = session.navigator.send(GetPathGoal(THERE)).wait()
    assert (result.message, result.planner) == ("an island", "planner")
    assert not session.careful.requests


@pytest.mark.parametrize("outcome", [GetPathOutcome.OUT_OF_MAP, GetPathOutcome.FAILURE, GetPathOutcome.INTERNAL_ERROR])
def test_other_failures_are_not_tried_by_the_second(make_pair, outcome):
    session = make_pair(planner_max_retries=0)
    session.planner.play(PlanResult(outcome, "something else"))
    assert session.navigator.send(GetPathGoal(THERE)).wait().outcome == outcome
    assert not session.careful.requests


@pytest.mark.parametrize("outcome", [GetPathOutcome.FAILURE, GetPathOutcome.EMPTY_PATH])
def test_after_other_failures_the_first_is_called_again(make_pair, outcome):
    session = make_pair(planner_max_retries=-1)
    session.planner.play(PlanResult(outcome, "something else"), straight_plan)
    result = session.navigator.send(GetPathGoal(THERE)).wait()
    assert (result.success, result.planner) == (True, "planner")
    assert (len(session.planner.requests), len(session.careful.requests)) == (2, 0)


def test_a_first_that_finds_no_path_when_called_again_leaves_it_to_the_second(make_pair):
    session = make_pair(planner_max_retries=-1)
    session.planner.play(PlanResult(GetPathOutcome.FAILURE, "something else"), NO_PATH)
    assert session.navigator.send(GetPathGoal(THERE)).wait().planner == "careful"
    assert (len(session.planner.requests), len(session.careful.requests)) == (2, 1)


def test_the_retries_are_those_of_the_second(make_pair):
    session = make_pair(planner_max_retries=-1)
    session.planner.play(NO_PATH)
    session.careful.play(NO_PATH, NO_PATH, straight_plan)
    assert session.navigator.send(GetPathGoal(THERE)).wait().success
    assert (len(session.planner.requests), len(session.careful.requests)) == (1, 3)


def test_where_neither_finds_a_path_the_result_has_both_reasons(make_pair):
    session = make_pair(planner_max_retries=0)
    session.planner.play(NO_PATH)
    session.careful.play(BLOCKED[1])
    result = session.navigator.send(GetPathGoal(THERE)).wait()
    assert result.outcome == GetPathOutcome.BLOCKED_START
    assert result.message == "careful: the start is blocked; before, planner: a wall"


def test_a_goal_that_names_the_second_has_no_other(make_pair):
    session = make_pair(planner_max_retries=0)
    session.careful.play(NO_PATH)
    result = session.navigator.send(GetPathGoal(THERE, planner="careful")).wait()
    assert (result.outcome, result.message) == (GetPathOutcome.NO_PATH_FOUND, "a wall")
    assert not session.planner.requests


def test_a_name_set_at_run_time_that_no_planner_has_is_in_the_message(make_pair):
    session = make_pair(planner_max_retries=0)
    session.server.set_parameters(fallback_planner="nobody")
    session.planner.play(NO_PATH)
    result = session.navigator.send(GetPathGoal(THERE)).wait()
    assert result.outcome == GetPathOutcome.NO_PATH_FOUND
    assert result.message.startswith("a wall; fallback_planner: no planner named 'nobody'")


def test_a_cancel_while_the_second_plans_ends_the_goal(make_pair):
    session = make_pair()
    session.planner.play(NO_PATH)

    def slowly(request):
        session.clock.sleep(1.0)
        return NO_PATH

    session.careful.play(slowly)
    handle = session.navigator.send(GetPathGoal(THERE))
    session.clock.sleep(0.5)
    handle.cancel("changed my mind")
    assert handle.wait().outcome == GetPathOutcome.CANCELED
    assert len(session.careful.requests) == 1


def test_move_base_drives_the_path_of_the_second_without_a_recovery(make_pair):
    session = make_pair()
    session.planner.play(NO_PATH)
    assert session.navigator.send(MoveBaseGoal(THERE)).wait().success
    assert not session.recorded(EventKind.RECOVERY)
