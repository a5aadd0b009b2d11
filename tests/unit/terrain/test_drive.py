"""Commands to wheels and back."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.geometry import AckermannCommand, Twist
from terrain.physics.drive import bicycle_angle, commanded_twist, steering_angle, twist_from_wheels, wheel_targets
from terrain.physics.robot_models import CAR, HUSKY, ROBOTS, TURTLEBOT, RobotSpec


@given(st.sampled_from([HUSKY, TURTLEBOT]), st.floats(-0.6, 0.6), st.floats(-1.8, 1.8))
def test_wheels_of_a_command_roll_that_command(spec: RobotSpec, vx: float, wz: float) -> None:
    targets = wheel_targets(spec, Twist.planar(vx, 0.0, wz))
    twist = twist_from_wheels(spec, targets.left, targets.right)
    assert (twist.vx, twist.wz) == pytest.approx((vx, wz), abs=1e-9)


@given(st.floats(0.1, 1.5), st.floats(-0.5, 0.5))
def test_all_axles_of_a_car_meet_in_one_point(speed: float, angle: float) -> None:
    targets = wheel_targets(CAR, AckermannCommand(speed, angle))
    twist = twist_from_wheels(CAR, targets.left, targets.right, angle)
    assert (twist.vx, twist.wz) == pytest.approx((speed, speed * math.tan(angle) / CAR.wheelbase), abs=1e-9)
    if abs(angle) > 0.01:
        left = CAR.wheelbase / math.tan(targets.steering_left) + 0.5 * CAR.track
        right = CAR.wheelbase / math.tan(targets.steering_right) - 0.5 * CAR.track
        assert left == pytest.approx(CAR.wheelbase / math.tan(angle)) and right == pytest.approx(left)
    assert bicycle_angle([targets.steering_left, targets.steering_right]) == pytest.approx(angle, abs=1e-12)


def test_commands_are_clipped_to_the_limits() -> None:
    assert commanded_twist(HUSKY, Twist.planar(9.0, 0.0, -9.0)) == Twist.planar(1.0, 0.0, -2.0)
    assert commanded_twist(CAR, AckermannCommand(9.0, 0.0)) == Twist.planar(1.5)
    tightest = commanded_twist(CAR, Twist.planar(1.0, 0.0, 9.0))
    assert tightest.vx / tightest.wz == pytest.approx(CAR.min_turning_radius)


def test_a_car_in_reverse_steers_the_other_way() -> None:
    assert steering_angle(CAR, Twist.planar(1.0, 0.0, 0.3)) > 0.0 > steering_angle(CAR, Twist.planar(-1.0, 0.0, 0.3))
    back = commanded_twist(CAR, Twist.planar(-1.0, 0.0, 0.3))
    assert (back.vx, back.wz) == pytest.approx((-1.0, 0.3))


@pytest.mark.parametrize("spec", ROBOTS.values(), ids=list(ROBOTS))
def test_radii_of_footprints(spec: RobotSpec) -> None:
    corners = spec.footprint_array()
    dense = np.concatenate([np.linspace(a, b, 400) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    distances = np.linalg.norm(dense, axis=1)
    assert spec.circumscribed_radius == pytest.approx(distances.max(), abs=1e-9)
    assert spec.urdf.is_file()
