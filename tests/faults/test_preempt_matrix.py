"""Fault table, row 16: a new goal while the old one runs or stops, with the same or another controller."""

import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome
from mbf_abstract.testing.faulty import slow
from mbf_abstract.testing.scripted import ScriptedController, straight_plan
from mbf_abstract.testing.scripted_session import SCRIPTED, ScriptedSession
from promises import assert_ended_once

TWO_CONTROLLERS = {**SCRIPTED, "other": ScriptedController}


def stops_between(session, start, end):
    return [stamp for stamp, command in session.robot.commands if start <= stamp <= end and command.is_stopped()]


@pytest.mark.parametrize("name", ["controller", ""])
def test_with_the_same_controller_the_path_is_swapped_and_the_robot_drives_on(name):
    with ScriptedSession(TWO_CONTROLLERS) as session:
        old = session.navigator.send(ExePathGoal(session.path_to(50.0), "controller"))
        session.clock.sleep(2.0)
        new = session.navigator.send(ExePathGoal(session.path_to(4.0), name))
        session.clock.sleep(1.0)
        assert (old.status, old.result.outcome) == (GoalStatus.CANCELED, ExePathOutcome.CANCELED)
        assert not stops_between(session, 0.0, session.clock.now())
        assert new.wait().success
        assert len(session.controller.paths) == 2
        for handle in (old, new):
            assert_ended_once(session, handle)


@pytest.mark.parametrize("stopping", [False, True], ids=["driving", "stopping"])
def test_with_another_controller_the_old_goal_ends_after_zero_and_then_the_new_one_starts(stopping):
    with ScriptedSession(TWO_CONTROLLERS) as session:
        session.controller.stops_itself = True
        old = session.navigator.send(ExePathGoal(session.path_to(50.0), "controller"))
        session.clock.sleep(2.0)
        if stopping:
            old.cancel()
            session.clock.sleep(0.1)
            assert old.status is GoalStatus.CANCELING
        new = session.navigator.send(ExePathGoal(session.path_to(4.0), "other"))
        old.wait()
        ended = session.clock.now()
        assert (old.status, bool(stops_between(session, 2.0, ended))) == (GoalStatus.CANCELED, True)
        assert new.wait().success
        assert session.plugin("other", ScriptedController).paths
        for handle in (old, new):
            assert_ended_once(session, handle)


def test_only_the_newest_goal_waits():
    with ScriptedSession() as session:
        session.planner.play(slow(session.clock, 0.5, straight_plan))
        handles = [session.navigator.send(GetPathGoal(Pose.planar(1.0 + i, 0.0))) for i in range(5)]
        for handle in handles:
            handle.wait()
            assert_ended_once(session, handle)
        statuses = [handle.status for handle in handles]
        assert statuses == [GoalStatus.CANCELED] * 4 + [GoalStatus.SUCCEEDED]
        assert all("preempted by a new goal" in handle.result.message for handle in handles[:4])


def test_a_superseded_move_base_goal_gets_its_own_end_and_the_robot_reaches_the_new_target():
    with ScriptedSession() as session:
        old = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        session.clock.sleep(2.0)
        new = session.navigator.send(MoveBaseGoal(Pose.planar(2.0, 1.0)))
        result = new.wait()
        assert (old.status, old.result.outcome) == (GoalStatus.CANCELED, MoveBaseOutcome.CANCELED)
        assert result.success
        assert result.dist_to_goal < 0.1
        for handle in (old, new):
            assert_ended_once(session, handle)
