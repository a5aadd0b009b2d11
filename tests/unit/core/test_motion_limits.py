"""What a robot makes of a command until the next one: a car keeps its curve as its accelerations are kept."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from mbf_abstract.geometry import Twist
from mbf_abstract.maps.controllers.motion_limits import MotionLimits

CAR = MotionLimits(-0.5, 1.0, 1.0, is_car=True, gain=0.1, side_gain=0.1, turn_gain=0.5)
SPEEDS, CURVATURES = (-0.5, -0.1, 0.0, 0.05, 0.4, 1.0), (-1.4, -0.3, 0.0, 0.7, 1.4)


def arc(speed, curvature):
    return Twist.planar(speed, wz=speed * curvature)


# command, measured: made of it
@pytest.mark.parametrize(
    ("command", "measured", "expected"),
    [
        (arc(1.0, 0.8), arc(0.2, 0.8), arc(0.3, 0.8)),  # its yaw rate could grow faster than its speed
        (arc(1.0, -0.8), Twist.planar(0.2), arc(0.3, -0.8)),
        (arc(-0.5, 0.8), arc(0.3, 0.8), arc(0.2, -0.8)),  # it still rolls forward, its wheels turned the other way
        (arc(0.5, 1.4), Twist.planar(0.5), Twist.planar(0.5, wz=0.5)),  # a wider curve, as its yaw rate grows slowly
        (Twist.planar(wz=1.0), Twist(), Twist()),  # standing it does not turn
    ],
)
def test_a_cars_curve_gets_no_tighter_than_commanded_as_its_accelerations_are_kept(command, measured, expected):
    made = CAR.reached(command, measured)
    assert (made.vx, made.vy, made.wz) == pytest.approx((expected.vx, 0.0, expected.wz))


@pytest.mark.parametrize("command", [Twist(), arc(0.5, 0.4), arc(0.5, 0.0)])
@pytest.mark.parametrize("curvature", [0.4, -0.4])
def test_a_car_whose_yaw_rate_changes_slowly_brakes_on_no_tighter_a_curve(command, curvature):
    made = replace(CAR, turn_gain=0.02).reached(command, arc(1.0, curvature))
    assert made.vx == pytest.approx(0.9)
    allowed = abs(command.wz / command.vx) if command.vx else 0.4
    assert made.wz == pytest.approx(0.9 * math.copysign(allowed, curvature))


@pytest.mark.parametrize(("speed", "now"), itertools.product(SPEEDS, SPEEDS))
def test_whatever_is_commanded_a_cars_speed_changes_as_allowed_and_its_curve_is_at_most_the_commanded_one(speed, now):
    for curvature, before in itertools.product(CURVATURES, CURVATURES):
        command, measured = arc(speed, curvature), arc(now, before)
        made = CAR.reached(command, measured)
        assert abs(made.vx - measured.vx) <= CAR.gain * (1.0 + 1e-5)
        tightest = abs(curvature if speed != 0.0 else before)
        assert abs(made.wz) <= tightest * abs(made.vx) + 1e-9, (command, measured)


def test_what_a_car_can_reach_is_returned_as_it_is():
    rng = np.random.default_rng(0)
    for speed, curvature in zip(rng.uniform(-0.5, 1.0, 20).tolist(), rng.uniform(-1.4, 1.4, 20).tolist(), strict=True):
        command = arc(speed, curvature)
        assert CAR.reached(command, command) == command
        assert CAR.reached(command, Twist.planar(speed - 0.05, wz=speed * curvature - 0.2)) == command


def test_a_robot_that_turns_on_the_spot_changes_its_speed_and_its_turn_each_by_itself():
    robot = MotionLimits(-0.5, 1.0, 1.0, gain=0.1, side_gain=0.1, turn_gain=0.5)
    assert robot.reached(arc(1.0, 0.8), Twist.planar(0.2)) == Twist.planar(0.2 + 0.1, wz=0.5)
    assert robot.reached(Twist.planar(wz=1.0), Twist()) == Twist.planar(wz=0.5)
