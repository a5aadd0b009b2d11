"""Fault table, row 7: commands beyond the robot's limits."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import AckermannCommand, Twist
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.faulty import drive
from mbf_abstract.testing.scripted_session import ScriptedSession

LIMITS = VelocityLimits(max_vel_x=1.0, min_vel_x=-0.3, max_vel_y=0.5, max_vel_theta=2.0, max_steering_angle=0.6)
number = st.floats(-50.0, 50.0).map(lambda value: round(value, 6))


@given(number, number, number)
def test_a_limited_twist_keeps_its_direction_and_its_limits(vx, vy, wz):
    asked = Twist.planar(vx, vy, wz)
    sent = LIMITS.apply(asked)
    slack = 1.0 + 1e-9
    assert LIMITS.min_vel_x * slack <= sent.vx <= LIMITS.max_vel_x * slack
    assert abs(sent.vy) <= LIMITS.max_vel_y * slack
    assert abs(sent.wz) <= LIMITS.max_vel_theta * slack
    pairs = zip((sent.vx, sent.vy, sent.wz), (vx, vy, wz), strict=True)
    scale = max((abs(given) / abs(wanted) for given, wanted in pairs if wanted), default=1.0)
    assert (sent.vx, sent.vy, sent.wz) == pytest.approx((vx * scale, vy * scale, wz * scale), abs=1e-12)
    assert 0.0 <= scale <= 1.0


@given(number, st.floats(-3.0, 3.0))
def test_a_limited_ackermann_command_keeps_each_limit(speed, angle):
    sent = LIMITS.apply(AckermannCommand(speed, angle))
    assert LIMITS.min_vel_x <= sent.speed <= LIMITS.max_vel_x
    assert abs(sent.steering_angle) <= LIMITS.max_steering_angle
    assert math.copysign(1.0, sent.steering_angle) == math.copysign(1.0, angle) or sent.steering_angle == 0.0


def test_within_the_limits_a_command_passes_untouched():
    command = Twist.planar(1.0, -0.5, 2.0)
    assert LIMITS.apply(command) is command


def test_the_robot_gets_the_limited_command_and_the_event_reports_both():
    with ScriptedSession(max_vel_x=0.4, max_vel_theta=0.8) as session:
        session.controller.play(drive(2.0, 1.0))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(1.0)
        handle.cancel()
        handle.wait()
        moving = session.robot.moved_after(-1.0)
        assert len(moving) >= 20
        assert all((command.vx, command.wz) == (0.4, 0.2) for _, command in moving)
        clamped = session.recorded(EventKind.COMMAND_CLAMPED)
        assert clamped[0].data == {"requested": [2.0, 0.0, 1.0], "sent": [0.4, 0.0, 0.2]}


def test_a_car_that_is_driven_with_twists_gets_no_curve_tighter_than_its_own():
    with ScriptedSession(min_turning_radius=1.0) as session:
        session.controller.play(drive(0.5, 1.0))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(0.5)
        handle.cancel()
        handle.wait()
        assert {(command.vx, command.wz) for _, command in session.robot.moved_after(-1.0)} == {(0.5, 0.5)}


def test_a_car_is_limited_in_speed_and_steering_angle():
    with ScriptedSession(max_vel_x=0.4, max_steering_angle=0.3) as session:
        session.controller.play(ControlResult(0, "go", AckermannCommand(2.0, 1.0)))
        handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
        session.clock.sleep(0.5)
        handle.cancel()
        handle.wait()
        assert {command for _, command in session.robot.moved_after(-1.0)} == {AckermannCommand(0.4, 0.3)}
        assert session.robot.command == AckermannCommand(0.0, 0.3)
