"""A goal that ran out of patience while another one used its plugin says so."""

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, RecoveryGoal, RefinePathGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.plugins import RecoveryResult, RefineResult
from mbf_abstract.testing.faulty import drive, slow
from mbf_abstract.testing.scripted import straight_plan

PATIENCE = {"planner_patience": 1.0, "controller_patience": 1.0, "recovery_patience": 1.0, "cancel_grace": 9.0}


def play(session):
    """Let every plugin take long over its call, or drive on for ever."""
    session.planner.play(slow(session.clock, 5.0, straight_plan))
    session.controller.play(drive())
    session.recovery.play(slow(session.clock, 5.0, RecoveryResult(0, "recovered")))
    session.refiner.play(slow(session.clock, 5.0, lambda path: RefineResult(0, "as it was", path)))


GOALS = {
    "planner": (lambda session, slot: GetPathGoal(Pose.planar(2.0, 0.0), concurrency_slot=slot), "get_path"),
    "controller": (lambda session, slot: ExePathGoal(session.path_to(50.0), concurrency_slot=slot), "exe_path"),
    "recovery": (lambda session, slot: RecoveryGoal(concurrency_slot=slot), "recovery"),
    "refiner": (lambda session, slot: RefinePathGoal(session.path_to(3.0), concurrency_slot=slot), "refine_path"),
}
OUTCOMES = {
    "planner": GetPathOutcome.PAT_EXCEEDED,
    "controller": ExePathOutcome.PAT_EXCEEDED,
    "recovery": RecoveryOutcome.PAT_EXCEEDED,
    "refiner": RefinePathOutcome.STOPPED,
}


@pytest.mark.parametrize("name", GOALS)
def test_a_goal_that_waited_in_vain_names_the_plugin_and_who_had_it(make_session, name):
    session = make_session(**PATIENCE)
    play(session)
    goal, action = GOALS[name]
    first = session.navigator.send(goal(session, 0))
    session.clock.sleep(0.1)
    result = session.navigator.send(goal(session, 1)).wait(3.0)
    assert result.outcome == OUTCOMES[name]
    assert result.message == f"waited 1 s for {name} {name!r}, which {action} goal {first.id} uses"


@pytest.mark.parametrize("name", GOALS)
def test_a_goal_that_is_canceled_while_it_waits_ends_canceled(make_session, name):
    session = make_session(**PATIENCE)
    play(session)
    goal, _ = GOALS[name]
    session.navigator.send(goal(session, 0))
    session.clock.sleep(0.1)
    second = session.navigator.send(goal(session, 1))
    session.clock.sleep(0.1)
    second.cancel("enough")
    assert second.wait(1.0).outcome_name == "CANCELED"
