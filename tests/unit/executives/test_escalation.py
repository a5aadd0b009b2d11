"""What the navigation tree does with a robot that is stuck, on a robot without walls."""

import pytest
from py_trees.common import Status

from mbf_abstract.events import EventKind
from mbf_abstract.executives.conditions import Do
from mbf_abstract.executives.escalation import Escalation
from mbf_abstract.executives.reference_trees import TreeOptions, navigation_tree
from mbf_abstract.executives.tree_executive import TreeExecutive
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.plugins import ControlResult, PlanResult, RecoveryResult
from mbf_abstract.testing.scripted import ScriptedRecovery, straight_plan

GOAL = Pose.planar(2.0, 0.0)
NO_PATH = PlanResult(GetPathOutcome.NO_PATH_FOUND, "walled in")
BLOCKED = ControlResult(ExePathOutcome.BLOCKED_PATH, "a chair")
LADDER = ("relax", "back_up")
OPTIONS = TreeOptions(check_poses=False, second_planner_pause=0.0, out_of_collision="")


def run(session, options=OPTIONS, target=GOAL):
    return TreeExecutive(navigation_tree(options), session.navigator).run(target)


def test_without_escalation_the_tree_does_what_it_did(make_session, recoveries):
    session = make_session()
    session.controller.play(*[BLOCKED] * 10, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["clear"] * 9  # the ninth failure costs a plan


def test_a_robot_that_is_stuck_gets_the_escalation_and_a_fresh_plan(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER)
    session.controller.play(*[BLOCKED] * 4, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["clear", "clear", "relax", "back_up"]
    assert len(session.planner.requests) == 3


def test_planning_that_fails_for_good_is_escalated_too(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER)
    session.planner.play(NO_PATH, NO_PATH, NO_PATH, straight_plan)
    assert run(session).success
    assert recoveries(session) == ["clear", "relax", "back_up"]


def test_it_gives_up_with_the_place_and_what_was_tried(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER)
    session.plugin("back_up", ScriptedRecovery).play(RecoveryResult(RecoveryOutcome.IMPASSABLE, "a wall"))
    session.controller.play(BLOCKED)
    result = run(session)
    assert recoveries(session) == ["clear", "clear", "relax", "back_up"]
    stuck = "stuck at (0.00, 0.00): BLOCKED_PATH 5 times; tried clear, relax, back_up (IMPASSABLE)"
    assert result.message == f"BLOCKED_PATH: a chair; {stuck}"
    assert result.mission.failure_code == ExePathOutcome.BLOCKED_PATH
    assert session.robot.command.is_stopped()
    assert len(session.recorded(EventKind.STUCK)) == 1


def test_a_task_that_leaves_no_failure_behind_is_not_escalated(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER)
    tree = Escalation("stuck?", Do("no", lambda mission: False))
    assert TreeExecutive(tree, session.navigator).run(GOAL).status == Status.FAILURE
    assert recoveries(session) == []


def test_a_target_that_makes_no_sense_is_not_escalated(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER, stuck_failures=1)
    session.planner.play(PlanResult(GetPathOutcome.INVALID_GOAL, "in the sky"))
    assert not run(session).success
    assert recoveries(session) == []


def test_each_run_has_the_whole_escalation(make_session, recoveries):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER, stuck_failures=1)
    session.planner.play(NO_PATH)
    executive = TreeExecutive(navigation_tree(OPTIONS), session.navigator)
    for _ in range(2):
        assert executive.run(GOAL).status == Status.FAILURE
    assert recoveries(session) == [*LADDER, *LADDER]


def test_the_state_of_the_escalation_can_be_read_from_the_events(make_session):
    session = make_session(stuck_time=0.0, escalation_behaviors=("relax",), stuck_failures=1)
    session.planner.play(NO_PATH, straight_plan)
    assert run(session).success
    tips = [event.data["new"] for event in session.recorded(EventKind.STATE_CHANGED) if event.source == "tree"]
    assert tips[:3] == ["get path", "escalate", "get path"]


@pytest.mark.parametrize("cycles", [2, 3])
def test_a_robot_that_is_not_stuck_keeps_its_usual_recoveries(make_session, recoveries, cycles):
    session = make_session(stuck_time=0.0, escalation_behaviors=LADDER, stuck_failures=cycles + 1)
    session.controller.play(*[BLOCKED] * cycles, session.controller.follow)
    assert run(session).success
    assert recoveries(session) == ["clear"] * cycles
