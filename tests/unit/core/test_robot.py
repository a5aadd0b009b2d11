"""The robot's state: fresh or refused, also what comes from the future, and the track it came by."""

import math

import numpy as np
import pytest

from mbf_abstract.drive.robot import TRACK_POINTS, TRACK_SPACING, Odometry, RobotInformation, RobotStateError
from mbf_abstract.geometry import Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.time.sim_clock import SimClock


class SilentRobot:
    """A robot without odometry."""

    def send_command(self, command):
        """Stay."""

    def odometry(self):
        return None


@pytest.fixture
def drive():
    """A robot's information, and a function that puts it at x, y and asks for its pose."""
    transforms, clock = TransformBuffer(), SimClock()
    information = RobotInformation(SilentRobot(), transforms, clock)

    def go(*points):
        for x, y in points:
            transforms.set(Transform((x, y, 0.0), stamp=clock.now()))
            information.pose()

    return information, go


def test_a_robot_that_was_never_seen_has_neither_pose_nor_track(drive):
    information, _ = drive
    with pytest.raises(RobotStateError, match="no fresh robot pose"):
        information.pose()
    assert information.recent_track().shape == (0, 3)


def test_the_track_keeps_points_a_spacing_apart(drive):
    information, go = drive
    go(*[(0.01 * step, 0.0) for step in range(101)])
    track = information.recent_track()
    assert track[0] == pytest.approx((0, 0, 0)) and track[-1, 0] > 0.94
    assert np.diff(track[:, 0]).min() >= TRACK_SPACING - 1e-9 and np.diff(track[:, 0]).max() < 2 * TRACK_SPACING


def test_a_robot_that_drives_back_rolls_its_track_up(drive):
    information, go = drive
    go(*[(0.2 * step, 0.0) for step in range(6)])
    go(*[(1.0 - 0.02 * step, 0.0) for step in range(26)])
    track = information.recent_track()
    assert (np.diff(track[:, 0]) > 0).all()
    assert track[-1, 0] == pytest.approx(0.5, abs=2 * TRACK_SPACING)


def test_a_long_way_forgets_its_oldest_part(drive):
    information, go = drive
    go(*[(0.1 * step, 1.0) for step in range(3 * TRACK_POINTS)])
    assert len(information.recent_track()) == TRACK_POINTS
    assert information.recent_track()[-1, 0] == pytest.approx(0.1 * (3 * TRACK_POINTS - 1))


class Driver:
    """Answers with what the test has set."""

    answer = None

    def send_command(self, command):
        """Stay."""

    def odometry(self):
        return self.answer


@pytest.fixture
def driver():
    """A driver, and the robot's information that asks it."""
    one, clock = Driver(), SimClock()
    clock.sleep(10.0)
    return one, RobotInformation(one, TransformBuffer(), clock, max_velocity_age=3.0)


@pytest.mark.parametrize(
    ("stamp", "text"),
    [
        (6.9, "3.10 s old"),
        (10.3, "stamped 0.30 s in the future"),
        (1e9, "stamped 999999990.00 s in the future"),
        (math.nan, "not finite"),
        (math.inf, "not finite"),
        ("now", "not finite"),
    ],
)
def test_odometry_of_another_time_is_refused(driver, stamp, text):
    driver[0].answer = Odometry(Twist.planar(0.5), stamp)
    with pytest.raises(RobotStateError, match=text):
        driver[1].velocity()


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        ((0.5, 0.0, 0.0), "answered with tuple"),
        (Odometry((0.5, 0.0, 0.0), 10.0), "holds tuple"),
        (Odometry(None, 10.0), "holds NoneType"),
        (Odometry(Twist.planar(1e200), 10.0), "is faster than 200 m/s or rad/s"),
        (Odometry(Twist.planar(0.1, wz=-1e4), 10.0), "is faster than 200 m/s or rad/s"),
    ],
)
def test_odometry_of_a_wrong_type_or_an_absurd_speed_is_no_odometry(driver, answer, text):
    driver[0].answer = answer
    with pytest.raises(RobotStateError, match=text):
        driver[1].velocity()


def test_odometry_a_little_ahead_is_two_clocks_that_differ(driver):
    driver[0].answer = Odometry(Twist.planar(0.5), 10.1)
    assert driver[1].velocity().vx == 0.5


def test_a_robot_whose_odometry_is_not_used_is_not_asked():
    one = Driver()
    one.answer = "nonsense"
    information = RobotInformation(one, TransformBuffer(), SimClock(), uses_odometry=False)
    assert information.velocity() == Twist() and not information.has_odometry
