"""A robot that carries its commands out late: controllers are given the pose and velocity of when they take effect."""

import math

import pytest

from mbf_abstract.drive.command_delay import CommandDelay
from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult

COMMANDS = [Twist.planar(0.5, wz=0.4), Twist.planar(0.3, 0.2, -1.0), Twist.planar(wz=1.5), Twist.planar(-0.4, wz=0.2)]


def moved(pose, command, duration):
    driven = arc_poses((pose.x, pose.y, pose.yaw), command.vx, command.vy, command.wz, duration, duration)
    return Pose.planar(*driven[-1].tolist())


@pytest.mark.parametrize("delay", [0.1, 0.25, 0.4])
def test_where_it_will_be_is_where_its_commands_of_the_last_moments_lead(delay):
    """Against a robot that is moved in steps of a millisecond by the command that is in effect then."""
    commands = CommandDelay()
    for k, command in enumerate(COMMANDS):
        commands.note(0.1 * k, command)
    now, pose = 0.3, Pose.planar(1.0, 2.0, 0.7)
    expected = pose
    for step in range(round(1000.0 * delay)):
        begun = [command for k, command in enumerate(COMMANDS) if 0.1 * k + delay <= now + 0.001 * (step + 0.5)]
        expected = moved(expected, begun[-1] if begun else Twist.planar(0.1), 0.001)
    predicted, velocity = commands.ahead(now, delay, pose, Twist.planar(0.1) if delay > 0.3 else COMMANDS[0])
    assert velocity == COMMANDS[-1]
    assert predicted.distance_to(expected) < 1e-3
    assert predicted.yaw == pytest.approx(expected.yaw, abs=1e-3)


def test_without_a_delay_nothing_is_predicted():
    commands, pose, velocity = CommandDelay(), Pose.planar(1.0, 2.0), Twist.planar(0.2)
    assert commands.ahead(1.0, 0.2, pose, velocity) == (pose, velocity)
    commands.note(1.0, Twist.planar(0.5))
    assert commands.ahead(1.0, 0.0, pose, velocity) == (pose, velocity)


def test_on_a_slope_it_moves_in_its_own_plane():
    commands, half = CommandDelay(), 0.25 * math.pi / 2.0
    commands.note(0.0, Twist.planar(1.0))
    up = Pose((0.0, 0.0, 0.0), (0.0, -math.sin(half), 0.0, math.cos(half)))
    there, _ = commands.ahead(5.0, 0.2, up, Twist.planar(1.0))
    assert there.position == pytest.approx((0.2 * math.cos(math.pi / 4), 0.0, 0.2 * math.sin(math.pi / 4)))


def test_a_command_with_a_steering_angle_counts_as_straight():
    commands = CommandDelay()
    commands.note(0.0, AckermannCommand(0.5, 0.3))
    assert commands.ahead(0.0, 0.1, Pose.planar(0.0, 0.0), Twist())[1] == Twist.planar(0.5)


@pytest.mark.parametrize("delay", [0.0, 0.2])
def test_a_controller_is_given_the_pose_of_when_its_command_takes_effect(make_session, delay):
    session = make_session(command_delay=delay)
    session.controller.play(ControlResult(ExePathOutcome.SUCCESS, "", Twist.planar(0.5)))
    handle = session.navigator.send(ExePathGoal(session.path_to(2.0)))
    session.clock.sleep(1.0)
    request = session.controller.requests[-1]
    assert request.pose.x - session.robot.pose.x == pytest.approx(0.5 * delay, abs=0.03)
    assert request.velocity == Twist.planar(0.5)
    handle.cancel()
