"""Fault table, row 9: the robot ignores its commands."""

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from tests.promises import assert_ended_once, assert_next_goals_work, assert_stops


def test_a_stuck_robot_ends_the_goal_with_robot_stuck_and_zero():
    with ScriptedSession(cmd_vel_ignored_tolerance=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(2.0)
        session.robot.stuck = True
        result = handle.wait()
        fault_time = session.clock.now()
        assert result.outcome == ExePathOutcome.ROBOT_STUCK
        assert 4.0 <= fault_time < 4.3
        assert session.robot.command.is_stopped()
        session.clock.sleep(2.0)
        assert_stops(session, fault_time)
        assert_ended_once(session, handle)
        session.robot.stuck = False
        assert_next_goals_work(session)


def test_a_robot_that_gets_free_in_time_drives_on():
    with ScriptedSession(cmd_vel_ignored_tolerance=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(2.0)))
        session.robot.stuck = True
        session.clock.sleep(1.5)
        assert abs(session.robot.pose.x) < 1e-9
        session.robot.stuck = False
        assert handle.wait().success
