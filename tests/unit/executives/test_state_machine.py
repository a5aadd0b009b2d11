"""State machines: transitions by status and by code, checks at construction, a machine inside a tree."""

from types import SimpleNamespace

import pytest
from py_trees.common import Status

from mbf_abstract.executives.leaves import ExePath, GetPath, Recovery
from mbf_abstract.executives.recovering import RecoveryNode
from mbf_abstract.executives.state_machine import State, StateMachine
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult

S, F = Status.SUCCESS, Status.FAILURE


def without_mission(machine):
    """A machine whose nodes never failed with a code."""
    machine.setup(mission=SimpleNamespace(failure_code=0))
    return machine


def fetch():
    return StateMachine(
        "fetch",
        {
            "plan": State(GetPath(), {S: "drive", F: F}),
            "drive": State(ExePath(), {S: S, ExePathOutcome.COLLISION: "back up", F: "plan"}),
            "back up": State(Recovery("back_up"), {S: "drive", F: F}),
        },
    )


def test_states_follow_each_other(make_session):
    session = make_session()
    assert TreeExecutive(fetch(), session.navigator).run(Pose.planar(1.0, 0.0)).success


def test_a_code_is_looked_for_before_failure(make_session, recoveries):
    session = make_session()
    blocked = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")
    session.controller.play(ControlResult(ExePathOutcome.COLLISION, "a wall"), blocked, session.controller.follow)
    assert TreeExecutive(fetch(), session.navigator).run(Pose.planar(1.0, 0.0)).success
    assert recoveries(session) == ["back_up"]
    assert len(session.planner.requests) == 2


def test_states_that_end_at_once_follow_within_one_tick(scripted, tick):
    machine = StateMachine("m", {"a": State(scripted("S"), {S: "b", F: F}), "b": State(scripted("S"), {S: S, F: F})})
    assert tick(machine) == "S"


def test_a_loop_of_instant_states_takes_one_turn_a_tick(scripted, tick):
    looping = scripted("SSF")
    machine = StateMachine("m", {"a": State(looping, {S: "a", F: S})})
    assert tick(without_mission(machine), 3) == "RRS"


def test_it_begins_with_its_first_state_each_time(scripted, tick):
    first, second = scripted("S"), scripted("F")
    machine = StateMachine("m", {"a": State(first, {S: "b", F: F}), "b": State(second, {S: S, F: F})})
    assert tick(without_mission(machine), 2) == "FF"
    assert (first.ticks, second.ticks) == (2, 2)


def test_all_mistakes_are_reported_at_once(scripted):
    with pytest.raises(ValueError) as error:
        StateMachine("m", {"a": State(scripted("S"), {S: "nowhere"}), "b": State(scripted("S"), {F: F})})
    text = str(error.value)
    assert "'nowhere', which is not a state" in text
    assert "state 'a' has no transition for FAILURE" in text
    assert "state 'b' has no transition for SUCCESS" in text


def test_a_machine_is_a_node_of_a_tree(make_session):
    session = make_session()
    session.planner.play(RuntimeError("boom"), session.planner._answers[0])
    tree = RecoveryNode("twice", [fetch(), Recovery("clear")])
    assert TreeExecutive(tree, session.navigator).run(Pose.planar(1.0, 0.0)).success
