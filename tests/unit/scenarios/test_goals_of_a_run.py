"""Goals that a run visits, where it is ended or sent elsewhere before its first one."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.outcomes import MoveBaseOutcome
from terrain.scenarios.scenario import PlanarPose, load_scenario
from terrain.scenarios.world_types import GeneratedWorld
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import AskedGoal, GoalSequence
from terrain.session.session import Session


@pytest.fixture
def session():
    """Gentle open ground, six metres to go."""
    world = GeneratedWorld(type="generated", size=(12.0, 10.0), spacing=0.25, median_slope=5.0)
    places = {"start": PlanarPose(x=3.0, y=5.0), "goals": (PlanarPose(x=9.0, y=5.0),)}
    with Session(load_scenario("outdoor").model_copy(update={"world": world, **places})) as running:
        yield running


@pytest.fixture
def sequence(session):
    return GoalSequence(session, make_executive("move_base", session.navigator))


def test_a_run_that_is_ended_before_its_first_goal_sends_none(session, sequence):
    sequence.end("another robot's run has failed")
    result = sequence.visit_goals()
    assert (result.outcome, result.message) == (MoveBaseOutcome.CANCELED, "another robot's run has failed")
    assert sequence.last_result is result
    assert not session.memory.of_kind(EventKind.GOAL_ACCEPTED)


def test_a_run_that_is_sent_elsewhere_before_its_first_goal_goes_there_only(session, sequence):
    elsewhere = session.world.pose_of(PlanarPose(x=3.8, y=5.0))
    sequence.go_to(AskedGoal(elsewhere))
    assert sequence.visit_goals().success
    assert session.robot.pose().distance_to(elsewhere) < 0.5
    accepted = [event for event in session.memory.of_kind(EventKind.GOAL_ACCEPTED) if event.source == "move_base"]
    assert len(accepted) == 1
