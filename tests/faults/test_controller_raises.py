"""Fault table, row 4: a controller raises while the robot drives."""

import pytest

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_a_raising_controller_stops_the_robot_and_ends_the_goal():
    with ScriptedSession() as session:
        session.controller.play(*[drive()] * 20, RuntimeError("boom"))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        result = handle.wait()
        fault_time = session.clock.now()
        assert len(session.controller.requests) == 21
        assert len(session.robot.moved_after(-1.0)) == 20  # it drove before
        assert result.outcome == ExePathOutcome.INTERNAL_ERROR
        assert "'controller' raised RuntimeError in compute_velocity_commands: boom" in result.message
        assert session.robot.command.is_stopped()  # at once, not by the watchdog
        session.clock.sleep(3.0)
        assert_stops(session, fault_time)
        assert_ended_once(session, handle)
        assert_next_goals_work(session)


@pytest.mark.parametrize("method", ["set_plan", "is_goal_reached", "cancel"])
def test_every_other_method_may_raise_too(method, monkeypatch):
    def boom(self, *arguments):
        raise RuntimeError(f"boom in {method}")

    with ScriptedSession() as session:
        monkeypatch.setattr(type(session.controller), method, boom)
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        handle.cancel()
        result = handle.wait()
        fault_time = session.clock.now()
        expected = {ExePathOutcome.INTERNAL_ERROR, ExePathOutcome.CANCELED}
        assert result.outcome in expected if method == "cancel" else result.outcome == ExePathOutcome.INTERNAL_ERROR
        session.clock.sleep(2.0)
        assert_stops(session, fault_time)
        monkeypatch.undo()
        assert_next_goals_work(session)


@pytest.mark.parametrize("answer", [None, "no"])
def test_an_arrival_that_is_neither_yes_nor_no_is_taken_for_neither(answer, monkeypatch):
    with ScriptedSession() as session:
        monkeypatch.setattr(type(session.controller), "is_goal_reached", lambda self, *arguments: answer)
        result = session.navigator.send(ExePathGoal(session.path_to(50.0))).wait()
        assert result.outcome == ExePathOutcome.INTERNAL_ERROR
        assert f"plugin 'controller' returned {type(answer).__name__} from is_goal_reached, not bool" in result.message
        monkeypatch.undo()
        assert_next_goals_work(session)
