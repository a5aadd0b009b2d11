"""Facts about velocities from the tests of Nav2's smoother, odometry filter and collision monitor, and of tf2."""

import math

import numpy as np
import pytest

from mbf_abstract.drive.robot import Odometry, RobotInformation
from mbf_abstract.drive.velocity_gate import VelocityGate
from mbf_abstract.drive.velocity_limits import VelocityLimits
from mbf_abstract.event_bus import EventBus
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses, in_robot_frame
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock


class Recorder:
    """A robot that keeps its commands and reports the odometry it was given."""

    def __init__(self):
        self.commands, self.measured = [], None

    def send_command(self, command):
        self.commands.append(command)

    def odometry(self):
        return self.measured


# ---------------------------------------------------------------------------------------------- velocity smoother
def test_f144_one_ratio_shrinks_all_components_of_a_command():
    # Nav2's ratio is one of accelerations. Ours is one of velocities: acceleration belongs to controller and robot.
    limited = VelocityLimits(max_vel_x=0.4, max_vel_y=1.0, max_vel_theta=1.0).apply(Twist.planar(0.5, 0.25, 0.125))
    assert (limited.vx, limited.vy, limited.wz) == pytest.approx((0.4, 0.2, 0.1))


def test_f146_commands_at_20_hz_are_limited_and_the_last_one_is_a_stop():
    clock, robot = SimClock(), Recorder()
    gate = VelocityGate(robot, clock, EventBus(clock.now, []), VelocityLimits(max_vel_x=0.5), command_timeout=0.5)
    lease = gate.acquire("test")
    for _ in range(30):
        lease.send(Twist.planar(1.0))
        clock.sleep(0.05)
    clock.sleep(2.0)
    assert 19 <= len(robot.commands) - 1 <= 30
    assert max(command.vx for command in robot.commands) == 0.5
    assert robot.commands[-1] == Twist() and not robot.commands[-2].is_stopped()
    gate.close()


# ------------------------------------------------------------------------------------------------- odometry filter
def test_f147_the_velocity_of_a_robot_is_the_last_one_measured():
    # Nav2 offers means over a window besides. Ours offers none: a driver that wants smooth odometry smooths it.
    clock, robot = SimClock(), Recorder()
    information = RobotInformation(robot, TransformBuffer(), clock)
    for value, stamp in ((1.0, 0.0), (2.0, 0.1), (3.0, 0.2), (4.0, 0.45), (5.0, 1.0)):
        clock.sleep(stamp - clock.now())
        robot.measured = Odometry(Twist.planar(value), stamp)
        assert information.velocity() == Twist.planar(value)


def test_f148_without_odometry_the_velocity_is_zero():
    information = RobotInformation(Recorder(), TransformBuffer(), SimClock())
    assert information.velocity() == Twist()
    assert information.measured_velocity() is None


# ------------------------------------------------------------------------------------------- twist from transforms
@pytest.mark.parametrize(("vx", "vy", "axis"), [(1, 0, 0), (-1, 0, 0), (0, 1, 1), (0, -1, 1)])
def test_f238_the_velocity_reported_is_that_of_the_frame_that_moves(vx, vy, axis):
    # tf2 makes a twist out of two transforms. Ours asks the driver; for the same motion both are the same.
    clock, transforms = SimClock(), TransformBuffer()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0, 0))
    robot.send_command(Twist.planar(vx, vy))
    clock.sleep(0.1)
    for _ in range(4):
        before, begin = transforms.lookup("map", "base_link"), clock.now()
        clock.sleep(1.0)
        moved = np.subtract(transforms.lookup("map", "base_link").translation, before.translation)
        expected = np.zeros(3)
        expected[axis] = vx + vy
        assert moved / (clock.now() - begin) == pytest.approx(expected, abs=1e-9)
        assert robot.odometry().velocity.linear == pytest.approx(tuple(expected))
    robot.close()


# ----------------------------------------------------------------------------------------------- collision monitor
def test_f149_a_body_that_moves_and_turns_for_a_second():
    # Nav2 takes a straight step along the velocity of the start, to (2, 2, 90 degrees). Ours is the exact arc, whose
    # chord is shorter and leads half the turn to the left; the velocity at its end points to 135 degrees in both.
    quarter, half = math.pi / 4, math.pi / 8
    body = math.cos(quarter), math.sin(quarter)  # 1 m/s to the north, for a robot that looks north-east
    poses = arc_poses((2.0, 1.0, quarter), *body, quarter, 1.0, 1e-3)
    chord = 2.0 * math.sin(half) / quarter
    expected = (2.0 + chord * math.cos(2 * quarter + half), 1.0 + chord * math.sin(2 * quarter + half), 2 * quarter)
    assert poses[-1] == pytest.approx(expected)
    dx, dy = poses[-1, :2] - poses[-2, :2]
    assert math.atan2(dy, dx) == pytest.approx(3 * quarter, abs=1e-3)
    straight = arc_poses((2.0, 1.0, quarter), *body, quarter, 1e-3, 1e-3)  # of a short time both are the same
    assert straight[-1, :2] == pytest.approx((2.0, 1.001), abs=1e-6)


@pytest.mark.parametrize(
    ("point", "seen"),
    [pytest.param((3, 2, 0), (1.3660, 0.3660), id="F150-ahead"), pytest.param((0, 0, 0), (-2.2321, 0.1340), id="F150")],
)
def test_points_as_seen_from_the_robot(point, seen):
    local = in_robot_frame(Pose.planar(2.0, 1.0, math.radians(30)), np.array(point, dtype=float))
    assert local[:2] == pytest.approx(seen, abs=1e-4)


def test_f314_the_distance_in_space_of_two_places():
    assert Pose((3.0, 1.0, 3.0)).distance_to(Pose((1.0, 3.0, 1.0))) == pytest.approx(3.4641, abs=1e-4)
