"""Fault table, row 36: a pose or an odometry that is stamped in the future."""

import math

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Pose, Twist, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.scripted_session import ScriptedSession
from promises import assert_ended_once, assert_next_goals_work, assert_stops

AHEAD = [0.9, 3.0, 1000.0, 1.79e9]  # s; the last is time.time() where the clock began at zero


def publish(session, ahead):
    """Publish the robot's true pose once more, with a stamp in the future."""
    pose, stamp = session.robot.pose, session.clock.now() + ahead
    session.transforms.set(Transform(pose.position, quaternion_from_yaw(pose.yaw), "odom", "base_link", stamp))
    session.transforms.set(Transform((0.0, 0.0, 0.0), parent="map", child="odom", stamp=stamp))


@pytest.mark.parametrize("ahead", AHEAD)
def test_one_pose_from_the_future_does_not_hide_that_the_localisation_is_silent(ahead):
    with ScriptedSession(tf_timeout=0.5, controller_patience=1.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        session.robot.publishes_pose = False
        publish(session, ahead)
        silent_since = session.clock.now()
        result = handle.wait()
        assert result.outcome == ExePathOutcome.TF_ERROR
        assert not session.robot.moved_after(silent_since + 0.6)
        assert_stops(session, silent_since + 0.5)
        assert_ended_once(session, handle)
        session.robot.publishes_pose = True
        session.clock.sleep(0.1)
        assert_next_goals_work(session)


@pytest.mark.parametrize("ahead", AHEAD[2:])
def test_one_wrong_stamp_among_good_ones_costs_nothing(ahead):
    with ScriptedSession(tf_timeout=0.5) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(2.0)))
        session.clock.sleep(1.0)
        publish(session, ahead)
        assert handle.wait().success
        assert session.navigator.robot_pose().distance_to(Pose.planar(2.0, 0.0)) < 0.2


@pytest.mark.parametrize("stamp", [1e9, math.nan, math.inf])
def test_odometry_without_a_true_time_holds_the_robot_and_ends_the_goal(monkeypatch, stamp):
    with ScriptedSession(controller_patience=1.0) as session:
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        monkeypatch.setattr(type(session.robot), "odometry", lambda self: Odometry(Twist.planar(0.5), stamp))
        fault_time = session.clock.now()
        result = handle.wait()
        assert result.outcome == ExePathOutcome.TF_ERROR
        assert "dometry" in result.message
        assert_stops(session, fault_time)
        monkeypatch.undo()
        assert_next_goals_work(session)
