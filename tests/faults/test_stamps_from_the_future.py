"""Fault table, row 36: a pose or an odometry that is stamped in the future."""

import math

import pytest

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Pose, Twist, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.testing.bench import Bench
from mbf_abstract.testing.promises import assert_ended_once, assert_next_goals_work, assert_stops

AHEAD = [0.9, 3.0, 1000.0, 1.79e9]  # s; the last is time.time() where the clock began at zero


def publish(bench, ahead):
    """Publish the robot's true pose once more, with a stamp in the future."""
    pose, stamp = bench.robot.pose, bench.clock.now() + ahead
    bench.transforms.set(Transform(pose.position, quaternion_from_yaw(pose.yaw), "odom", "base_link", stamp))
    bench.transforms.set(Transform((0.0, 0.0, 0.0), parent="map", child="odom", stamp=stamp))


@pytest.mark.parametrize("ahead", AHEAD)
def test_one_pose_from_the_future_does_not_hide_that_the_localisation_is_silent(ahead):
    with Bench(tf_timeout=0.5, controller_patience=1.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(1.0)
        bench.robot.publishes_pose = False
        publish(bench, ahead)
        silent_since = bench.clock.now()
        result = handle.wait()
        assert result.outcome == ExePathOutcome.TF_ERROR
        assert not bench.robot.moved_after(silent_since + 0.6)
        assert_stops(bench, silent_since + 0.5)
        assert_ended_once(bench, handle)
        bench.robot.publishes_pose = True
        bench.clock.sleep(0.1)
        assert_next_goals_work(bench)


@pytest.mark.parametrize("ahead", AHEAD[2:])
def test_one_wrong_stamp_among_good_ones_costs_nothing(ahead):
    with Bench(tf_timeout=0.5) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(2.0)))
        bench.clock.sleep(1.0)
        publish(bench, ahead)
        assert handle.wait().success
        assert bench.navigator.robot_pose().distance_to(Pose.planar(2.0, 0.0)) < 0.2


@pytest.mark.parametrize("stamp", [1e9, math.nan, math.inf])
def test_odometry_without_a_true_time_holds_the_robot_and_ends_the_goal(monkeypatch, stamp):
    with Bench(controller_patience=1.0) as bench:
        handle = bench.navigator.send(ExePathGoal(bench.path_to(50.0)))
        bench.clock.sleep(1.0)
        monkeypatch.setattr(type(bench.robot), "odometry", lambda self: Odometry(Twist.planar(0.5), stamp))
        fault_time = bench.clock.now()
        result = handle.wait()
        assert result.outcome == ExePathOutcome.TF_ERROR
        assert "dometry" in result.message
        assert_stops(bench, fault_time)
        monkeypatch.undo()
        assert_next_goals_work(bench)
