"""Fault table, row 9: the robot ignores its commands."""

import itertools

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Twist
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops


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


def test_a_robot_whose_wheels_slip_on_the_spot_is_stuck_though_it_shivers():
    with ScriptedSession(cmd_vel_ignored_tolerance=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        slips = itertools.cycle([0.04, -0.03, 0.02])
        session.robot.odometry = lambda: Odometry(Twist.planar(next(slips)), session.clock.now())
        result = handle.wait()
        assert result.outcome == ExePathOutcome.ROBOT_STUCK
        assert 2.0 <= session.clock.now() < 2.3


def test_a_robot_that_climbs_slowly_is_not_stuck():
    with ScriptedSession(cmd_vel_ignored_tolerance=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.robot.odometry = lambda: Odometry(Twist.planar(0.2), session.clock.now())
        session.clock.sleep(5.0)
        assert not handle.done


def test_a_robot_that_gets_free_in_time_drives_on():
    with ScriptedSession(cmd_vel_ignored_tolerance=2.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(2.0)))
        session.robot.stuck = True
        session.clock.sleep(1.5)
        assert abs(session.robot.pose.x) < 1e-9
        session.robot.stuck = False
        assert handle.wait().success
