"""Where a robot can turn only at the exact end of its path, it looks at the whole turn before it begins."""

import math

import numpy as np
import pytest

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.controllers.end_of_path import EXACTLY, FAST, SLOW, at_exact_end, swept_poses, turn_left


def tracker_at(x, backward=False):
    poses = [Pose.planar(0.1 * k, 0.0, math.pi if backward else 0.0) for k in range(11)]
    tracker = PathTracker(Path.from_poses(poses), dimensions=2)
    tracker.update((x, 0.0))
    return tracker


def turning(angle):
    return Twist.planar(wz=angle)


@pytest.mark.parametrize("turn", [2.0, -2.0])
def test_the_shorter_turn_comes_first_then_creeping_on_then_the_longer_turn(turn):
    motions = at_exact_end(Pose.planar(0.92, 0.0), tracker_at(0.92), False, turn, turning)
    assert [motion.wz for motion in motions] == pytest.approx([turn, 0.0, turn - math.copysign(2 * math.pi, turn)])
    assert motions[1].vx == pytest.approx(0.08)


@pytest.mark.parametrize(("left", "speed"), [(0.5, FAST), (0.004, SLOW)])
@pytest.mark.parametrize("backward", [False, True])
def test_it_creeps_to_the_goal_itself_forward_or_backward(left, speed, backward):
    here = Pose.planar(1.0 - left, 0.25 * left, math.pi if backward else 0.0)
    creeping = at_exact_end(here, tracker_at(1.0 - left, backward), backward, 1.0, turning)[1]
    assert creeping.vx == pytest.approx(-speed if backward else speed)
    assert creeping.wz < 0.0, "it turns towards the goal"


@pytest.mark.parametrize(("x", "yaw"), [(1.0 - 0.5 * EXACTLY, 0.0), (0.9, 1.0)])
def test_at_the_end_or_where_the_goal_is_not_ahead_it_only_turns(x, yaw):
    motions = at_exact_end(Pose.planar(x, 0.0, yaw), tracker_at(x), False, 1.0, turning)
    assert [motion.vx for motion in motions] == [0.0, 0.0]


@pytest.mark.parametrize(("turn", "rate", "left"), [(1.0, 0.5, 1.0), (1.0, -0.5, 2 * math.pi - 1.0), (-1.0, -1.8, 1.0)])
def test_a_turn_goes_on_to_the_heading_to_either_side(turn, rate, left):
    assert turn_left(turn, turning(rate)) == pytest.approx(left)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_way_around_a_robot_finds_no_heading_that_it_has_not_looked_at_before(sign):
    whole = swept_poses(Pose.planar(1.0, 2.0, 0.123), 1.5 * sign, 0.01)
    rest = swept_poses(Pose.planar(1.0, 2.0, 0.123 + 0.777 * sign), 0.723 * sign, 0.01)
    assert np.allclose(whole[:, :2], (1.0, 2.0)) and np.all(sign * np.diff(whole[:, 2]) > 0.0)
    assert np.abs(np.diff(whole[:, 2])).max() <= 0.01 + 1e-9 and whole[-1, 2] == pytest.approx(0.123 + 1.5 * sign)
    assert np.allclose(rest[:, 2], whole[-len(rest) :, 2])
