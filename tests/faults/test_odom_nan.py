"""Fault table, row 14: odometry is missing or not a number."""

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Twist
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_silent_odometry_holds_the_robot_and_ends_the_goal_with_its_age():
    with ScriptedSession(tf_timeout=0.5, controller_patience=1.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        session.robot.publishes_odometry = False
        result = handle.wait()
        assert result.outcome == ExePathOutcome.TF_ERROR
        assert "odometry is" in result.message
        assert "s old" in result.message
        assert_stops(session, 1.5)
        assert_ended_once(session, handle)
        session.robot.publishes_odometry = True
        session.clock.sleep(0.1)
        assert_next_goals_work(session)


@pytest.mark.parametrize("error", [RuntimeError("serial port closed"), None], ids=["raises", "nan"])
def test_a_driver_that_fails_to_give_odometry_stops_the_robot(error, monkeypatch):
    def broken(self):
        if error is not None:
            raise error
        return Odometry(Twist.planar(float("nan")), 0.0)  # refused by the border: a ValueError

    with ScriptedSession(controller_patience=1.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        assert not session.robot.command.is_stopped()
        monkeypatch.setattr(type(session.robot), "odometry", broken)
        result = handle.wait()
        fault_time = session.clock.now()
        assert not result.success
        assert "odometry" in result.message
        session.clock.sleep(2.0)
        assert_stops(session, fault_time)
        assert_ended_once(session, handle)
        monkeypatch.undo()
        assert_next_goals_work(session)
