"""Fault table, row 12: the localisation jumps (map -> odom)."""

from dataclasses import replace

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once


def jump(session, x, y):
    """Let the localisation notice that the robot stands somewhere else than it thought."""
    session.robot.T_map_odom = replace(session.robot.T_map_odom, translation=(x, y, 0.0))


def test_after_a_jump_the_path_is_followed_from_the_new_pose():
    with ScriptedSession(oscillation_timeout=5.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(4.0)))
        session.clock.sleep(2.0)
        before = session.robot.pose
        jump(session, 0.0, 0.6)
        assert session.robot.pose.distance_to(before) > 0.59  # the fault happened
        result = handle.wait()
        assert result.success
        assert result.final_pose.distance_to(session.path_to(4.0)[-1]) < 0.11
        assert_ended_once(session, handle)


def test_a_jump_away_from_the_goal_is_no_arrival_and_one_onto_it_is():
    with ScriptedSession() as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(4.0)))
        session.clock.sleep(7.0)
        jump(session, -1.0, 0.0)
        session.clock.sleep(1.0)
        assert not handle.done
        jump(session, 4.0 - (session.robot.pose.x + 1.0), 0.0)
        assert handle.wait().success
