"""Fault table, row 2: a planner hangs and ignores its cancel token."""

import pytest

from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.goal_types import GetPathGoal
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.testing.faulty import BusyHang, Hang, slow
from mbf_abstract.testing.scripted import ScriptedPlanner, straight_plan
from mbf_abstract.testing.scripted_session import SCRIPTED, ScriptedSession
from mbf_abstract.time.sim_clock import SimClock
from promises import assert_ended_once, assert_next_goals_work

GOAL = GetPathGoal(Pose.planar(3.0, 0.0))


def test_a_hanging_planner_ends_its_goal_after_patience_and_grace_and_is_quarantined():
    with ScriptedSession(planner_patience=2.0, cancel_grace=1.0) as session:
        hang = Hang(session.clock, then=None)
        session.planner.play(hang)
        handle = session.navigator.send(GOAL)
        result = handle.wait()
        assert (hang.entered, hang.left) == (1, 0)
        assert result.outcome == GetPathOutcome.PAT_EXCEEDED
        assert "'planner'" in result.message
        assert 3.0 <= session.clock.now() < 3.2
        assert_ended_once(session, handle)
        rejected = session.navigator.send(GOAL)
        assert rejected.status is GoalStatus.REJECTED
        assert "quarantined" in rejected.result.message
        hang.release()


def test_another_planner_serves_the_same_slot_while_the_first_hangs():
    with ScriptedSession({**SCRIPTED, "second": ScriptedPlanner}, planner_patience=1.0, cancel_grace=0.5) as session:
        hang = Hang(session.clock)
        session.planner.play(hang)
        session.navigator.send(GOAL).wait()
        assert hang.entered == 1
        assert session.navigator.get_path(Pose.planar(3.0, 0.0), planner="second").success
        hang.release()


def test_the_plugin_is_back_once_its_late_call_returns():
    with ScriptedSession(planner_patience=1.0, cancel_grace=0.5) as session:
        hang = Hang(session.clock)
        session.planner.play(hang)
        handle = session.navigator.send(GOAL)
        handle.wait()
        hang.release()
        session.clock.sleep(0.1)
        assert hang.left == 1
        assert_ended_once(session, handle)
        assert_next_goals_work(session)
        assert not session.server.runtime.hanging
        assert len(session.recorded(EventKind.QUARANTINE)) == 2


def test_a_cancel_of_a_hanging_planner_ends_after_the_grace():
    with ScriptedSession(planner_patience=0.0, cancel_grace=1.0) as session:
        hang = Hang(session.clock)
        session.planner.play(hang)
        handle = session.navigator.send(GOAL)
        session.clock.sleep(5.0)
        handle.cancel()
        assert handle.wait().outcome == GetPathOutcome.CANCELED
        assert session.clock.now() == pytest.approx(6.0, abs=0.1)
        hang.release()


def test_hanging_planners_are_capped():
    names = {f"planner{i}": ScriptedPlanner for i in range(4)}
    with ScriptedSession(names, planner_patience=0.5, cancel_grace=0.5, max_quarantined=3) as session:
        hang = Hang(session.clock)
        for name in names:
            session.plugin(name, ScriptedPlanner).play(hang)
        handles = [session.navigator.send(GetPathGoal(GOAL.target_pose, planner=name)) for name in list(names)[:1]]
        for index, name in enumerate(list(names)[1:3], start=1):
            handles.append(session.navigator.send(GetPathGoal(GOAL.target_pose, planner=name, concurrency_slot=index)))
        for handle in handles:
            handle.wait()
        assert (hang.entered, len(session.server.runtime.hanging)) == (3, 3)
        rejected = session.navigator.send(GetPathGoal(GOAL.target_pose, planner="planner3"))
        assert rejected.status is GoalStatus.REJECTED
        assert "3 plugin calls hang" in rejected.result.message
        hang.release()


def test_a_planner_that_keeps_the_processor_busy_is_found_by_the_wall_clock_guard():
    with ScriptedSession(clock=SimClock(), hang_guard=0.2, planner_patience=5.0) as session:
        hang = BusyHang()
        session.planner.play(hang)
        handle = session.navigator.send(GOAL)
        result = handle.wait()
        text = "took more than 0.2 s of real time while simulated time stood still (hang_guard)"
        assert result.message == f"planner 'planner' {text}"
        assert session.navigator.send(GOAL).result.message == f"planner 'planner' is quarantined: it {text}"
        hang.release.cancel()
        assert (hang.entered, result.outcome) == (1, GetPathOutcome.PAT_EXCEEDED)
        assert_ended_once(session, handle)


@pytest.mark.parametrize(("hanging", "healthy"), [("nav.plan", "nav"), ("nav", "nav.plan")])
def test_a_busy_planner_takes_no_other_one_with_it_whatever_their_names(hanging, healthy):
    with ScriptedSession(
        {"nav": ScriptedPlanner, "nav.plan": ScriptedPlanner}, hang_guard=0.2, planner_patience=5.0
    ) as session:
        hang = BusyHang()
        session.plugin(hanging, ScriptedPlanner).play(hang)
        session.plugin(healthy, ScriptedPlanner).play(slow(session.clock, 1.0, straight_plan))
        other = session.navigator.send(GetPathGoal(GOAL.target_pose, planner=healthy, concurrency_slot=1))
        session.clock.sleep(0.1)
        handle = session.navigator.send(GetPathGoal(GOAL.target_pose, planner=hanging))
        assert handle.wait().outcome == GetPathOutcome.PAT_EXCEEDED
        hang.release.cancel()
        assert hang.entered == 1
        assert other.wait().success


def test_a_busy_planner_takes_none_of_another_server_on_the_same_clock_with_it():
    clock = SimClock()
    with ScriptedSession(clock=clock, hang_guard=0.2) as first, ScriptedSession(clock=clock, hang_guard=0.2) as second:
        hang = BusyHang()
        first.planner.play(hang)
        second.planner.play(slow(clock, 1.0, straight_plan))
        other = second.navigator.send(GOAL)
        clock.sleep(0.1)
        assert first.navigator.send(GOAL).wait().outcome == GetPathOutcome.PAT_EXCEEDED
        hang.release.cancel()
        assert other.wait().success
