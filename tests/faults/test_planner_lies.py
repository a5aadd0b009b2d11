"""Fault table, row 3: a planner "succeeds" with a path that cannot be followed."""

from dataclasses import replace

import pytest

from mbf_abstract.event_sinks import JsonLinesSink, read_events
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome, RefinePathOutcome, is_success
from mbf_abstract.plugins import PlanResult, RefineResult
from mbf_abstract.testing import faulty
from mbf_abstract.testing.scripted import straight_plan
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work


def outcome(code, message="found"):
    return lambda request: replace(straight_plan(request), outcome=code, message=message)


def path_as(kind):
    return lambda request: replace(plan := straight_plan(request), path=kind(plan.path))


def cost(value):
    return lambda request: replace(straight_plan(request), cost=value)


@pytest.mark.parametrize(
    ("lie", "outcome", "text"),
    [
        (faulty.no_path, GetPathOutcome.EMPTY_PATH, "no poses"),
        (faulty.empty_path, GetPathOutcome.EMPTY_PATH, "no poses"),
        (faulty.nan_path, GetPathOutcome.INTERNAL_ERROR, "pose 1 of the path is not finite: [nan"),
        (faulty.wrong_frame_path, GetPathOutcome.TF_ERROR, "'nowhere'"),
        (faulty.path_that_ends_elsewhere, GetPathOutcome.INTERNAL_ERROR, "5.00 m from the goal"),
        (faulty.path_that_starts_elsewhere, GetPathOutcome.INTERNAL_ERROR, "pose 0 of the path is 5.00 m"),
        (lambda request: None, GetPathOutcome.INTERNAL_ERROR, "returned NoneType from make_plan"),
        (lambda request: (0, "found"), GetPathOutcome.INTERNAL_ERROR, "returned tuple from make_plan"),
        (outcome(10**5000), GetPathOutcome.INTERNAL_ERROR, "an outcome outside of 0..4294967295"),
        (outcome(-1), GetPathOutcome.INTERNAL_ERROR, "an outcome outside of 0..4294967295"),
        (outcome(False), GetPathOutcome.INTERNAL_ERROR, "an outcome of type bool, not an integer"),
        (outcome("0"), GetPathOutcome.INTERNAL_ERROR, "an outcome of type str, not an integer"),
        (outcome(0, None), GetPathOutcome.INTERNAL_ERROR, "a message of type NoneType, not str"),
        (
            path_as(list),
            GetPathOutcome.INTERNAL_ERROR,
            "'planner' returned a path of type list, not Path, from make_plan",
        ),
        (cost("cheap"), GetPathOutcome.INTERNAL_ERROR, "'planner' returned a cost of type str, not a number"),
        (cost(float("nan")), GetPathOutcome.INTERNAL_ERROR, "'planner' returned a cost of nan, which is no number"),
    ],
)
def test_a_lie_becomes_a_failure_that_names_it(lie, outcome, text):
    with ScriptedSession() as session:
        session.planner.play(lie)
        handle = session.navigator.send(GetPathGoal(Pose.planar(3.0, 0.0)))
        result = handle.wait()
        assert len(session.planner.requests) == 1  # the wrong claim was made
        assert (result.outcome, result.path) == (outcome, None)
        assert text in result.message and "'planner'" in result.message
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


@pytest.mark.parametrize("error", [RuntimeError("no tile"), KeyError("map")])
def test_a_map_that_cannot_say_whether_a_path_leaves_it_is_named(error, monkeypatch):
    def failing(path):
        raise error

    with ScriptedSession() as session:
        monkeypatch.setattr(session.server, "path_problem", failing)
        result = session.navigator.get_path(Pose.planar(3.0, 0.0))
        assert (result.outcome, result.path) == (GetPathOutcome.INTERNAL_ERROR, None)
        assert f"path_problem raised {type(error).__name__}" in result.message
        monkeypatch.undo()
        assert_next_goals_work(session)


def test_an_outcome_of_another_action_does_not_pass_as_success():
    with ScriptedSession(planner_max_retries=0) as session:
        session.planner.play(PlanResult(999, "strange"))
        assert not is_success(session.navigator.get_path(Pose.planar(3.0, 0.0)).outcome)


def test_no_outcome_and_no_message_ends_the_record_of_the_run(tmp_path):
    with ScriptedSession() as session:
        session.events.add_sink(JsonLinesSink(tmp_path / "events.jsonl"))
        huge = "x" * 30_000_000
        session.planner.play(outcome(10**5000), outcome(0, huge), RuntimeError(huge), straight_plan)
        for _ in range(4):
            session.navigator.get_path(Pose.planar(3.0, 0.0))
        session.events.close()
        ends = [event for event in read_events(tmp_path / "events.jsonl") if event.kind is EventKind.GOAL_FINISHED]
        assert [event.data["outcome"] for event in ends] == [62, 0, 62, 0]
        assert (tmp_path / "events.jsonl").stat().st_size < 100_000


def test_a_refiner_that_gives_a_list_of_poses_is_named():
    with ScriptedSession() as session:
        session.refiner.play(lambda path: RefineResult(0, "refined", list(path)))
        result = session.navigator.refine_path(session.path_to(3.0))
        assert result.outcome == RefinePathOutcome.INTERNAL_ERROR
        assert "'refiner' returned a path of type list, not Path, from apply_refinement" in result.message
