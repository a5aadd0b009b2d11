"""A failure of planning that cannot change ends the goal at once; one that can is tried again."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal, MoveBaseGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted import straight_plan

FAR = Pose.planar(900.0, 0.0)
ANSWERS = [
    PlanResult(GetPathOutcome.OUT_OF_MAP, "the goal is outside"),
    PlanResult(GetPathOutcome.INVALID_START, "the start is no place"),
    PlanResult(GetPathOutcome.INVALID_GOAL, "the goal is no place"),
    PlanResult(GetPathOutcome.NO_PATH_FOUND, "an island", permanent=True),
]


@pytest.mark.parametrize("answer", ANSWERS, ids=lambda answer: answer.message)
@pytest.mark.parametrize("retries", [-1, 0, 5])
def test_get_path_asks_once_and_ends_with_the_planners_own_words(make_session, answer, retries):
    session = make_session(planner_max_retries=retries)
    session.planner.play(answer)
    result = session.navigator.send(GetPathGoal(FAR)).wait()
    assert (result.outcome, result.message, result.permanent) == (answer.outcome, answer.message, True)
    assert len(session.planner.requests) == 1
    assert session.clock.now() == 0.0


@pytest.mark.parametrize("answer", ANSWERS, ids=lambda answer: answer.message)
def test_move_base_ends_at_once_without_recoveries(make_session, answer):
    session = make_session()
    session.planner.play(answer)
    result = session.navigator.send(MoveBaseGoal(FAR)).wait()
    assert (result.outcome, result.message) == (answer.outcome, answer.message)
    assert not session.recorded(EventKind.RECOVERY)
    assert session.clock.now() == 0.0


def test_a_new_goal_that_can_never_be_reached_stops_the_robot_and_ends(make_session):
    session = make_session()
    session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
    session.clock.sleep(1.0)
    session.planner.play(ANSWERS[0])
    result = session.navigator.send(MoveBaseGoal(FAR)).wait()
    assert result.outcome == GetPathOutcome.OUT_OF_MAP
    assert session.robot.command.is_stopped()
    assert not session.recorded(EventKind.RECOVERY)


def test_a_replanning_that_fails_so_while_the_robot_drives_keeps_the_path(make_session):
    session = make_session(planner_frequency=2.0)
    session.planner.play(straight_plan, ANSWERS[0])
    assert session.navigator.send(MoveBaseGoal(Pose.planar(2.0, 0.0))).wait().success


def test_what_may_change_is_tried_again(make_session):
    session = make_session()
    session.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "somebody is in the way"), straight_plan)
    assert session.navigator.send(GetPathGoal(Pose.planar(2.0, 0.0))).wait().success
    assert len(session.planner.requests) == 2


BLOCKED_START = PlanResult(GetPathOutcome.BLOCKED_START, "in a keep-out area", permanent=True)


def test_a_start_that_stays_blocked_is_asked_once_but_a_robot_may_be_moved_off_it(make_session):
    session = make_session()
    session.planner.play(BLOCKED_START)
    assert session.navigator.send(GetPathGoal(FAR)).wait().outcome == GetPathOutcome.BLOCKED_START
    assert len(session.planner.requests) == 1
    session.planner.play(BLOCKED_START, straight_plan)
    assert session.navigator.send(MoveBaseGoal(Pose.planar(2.0, 0.0))).wait().success
    assert len(session.recorded(EventKind.RECOVERY)) == 1
