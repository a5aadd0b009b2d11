"""move_base with a plan_refiner: every plan goes through it before it is followed."""

import numpy as np
import pytest

from mbf_abstract.geometry import Path
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.outcomes import MoveBaseOutcome as Outcome
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.plugins import RefineResult
from mbf_abstract.testing.scripted import ScriptedController, ScriptedPlanner, ScriptedRefiner

PLUGINS = {"planner": ScriptedPlanner, "controller": ScriptedController, "refiner": ScriptedRefiner}


@pytest.fixture
def make_refining(make_session):
    """Make sessions in which every plan goes through the scripted refiner."""

    def make(**parameters):
        return make_session(plugins=PLUGINS, plan_refiner="refiner", **parameters)

    return make


def over_a_corner(path):
    """A longer path between the same ends, which nobody takes for the plan."""
    ends = path.positions[[0, -1]]
    corner = ends.mean(axis=0) + np.array([0.0, 0.5, 0.0])
    return RefineResult(0, "", Path.from_points([ends[0], corner, ends[1]], path[-1].orientation))


def slowly(session, seconds):
    """Hand the path back after so many seconds."""

    def answer(path):
        session.clock.sleep(seconds)
        return RefineResult(0, "", path)

    return answer


def farthest_left(session):
    return max(request.pose.y for request in session.controller.requests)


def test_the_refined_path_is_followed(make_refining):
    session = make_refining()
    session.refiner.play(over_a_corner)
    assert session.send().wait().outcome == Outcome.SUCCESS
    assert len(session.refiner.requests) == 1
    assert farthest_left(session) > 0.2


def test_a_refiner_that_raises_is_named_at_the_end_of_a_goal_that_succeeds_without_it(make_refining):
    session = make_refining()
    session.refiner.play(ValueError("no idea"))
    raised = "plugin 'refiner' raised ValueError in apply_refinement: no idea"
    assert session.send().wait().message == f"goal reached; its plan was not refined: {raised}"
    session.refiner.play(over_a_corner)
    assert session.send(0.0).wait().message == "goal reached"


def test_a_plan_that_cannot_be_refined_is_followed_as_it_is(make_refining):
    session = make_refining()
    session.refiner.play(RefineResult(RefinePathOutcome.FAILURE, "too rough"))
    assert session.send().wait().outcome == Outcome.SUCCESS
    assert farthest_left(session) == pytest.approx(0.0, abs=1e-9)


def test_plans_made_while_driving_are_refined_too(make_refining):
    session = make_refining(planner_frequency=2.0)
    assert session.send().wait().outcome == Outcome.SUCCESS
    assert len(session.refiner.requests) == session.plans > 2


def test_a_cancel_while_refining_ends_the_goal_before_anything_is_driven(make_refining):
    session = make_refining()
    session.refiner.play(slowly(session, 0.5))
    handle = session.send()
    session.clock.sleep(0.2)
    handle.cancel("enough")
    assert handle.wait().outcome == Outcome.CANCELED
    assert handle.status is GoalStatus.CANCELED
    assert session.controller.requests == []


def test_a_newer_goal_while_refining_is_planned_refined_and_followed(make_refining):
    session = make_refining()
    session.refiner.play(slowly(session, 0.5))
    older = session.send()
    session.clock.sleep(0.2)
    newer = session.send(0.0, 2.0)
    assert older.wait().outcome == Outcome.CANCELED
    assert newer.wait().outcome == Outcome.SUCCESS
    assert [path[-1].y for path in session.refiner.requests] == [0.0, 2.0]
    assert max(request.pose.x for request in session.controller.requests) < 0.2


def test_a_refiner_that_is_not_loaded_is_refused(make_refining):
    session = make_refining()
    session.server.set_parameters(plan_refiner="smother")
    result = session.send().wait()
    assert result.outcome == Outcome.FAILURE
    assert "smother" in result.message
    assert session.plans == 0
