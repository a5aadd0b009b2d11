"""The robot's state: fresh or refused, and the track it came by."""

import numpy as np
import pytest

from mbf_abstract.robot import TRACK_POINTS, TRACK_SPACING, RobotInformation, RobotStateError
from mbf_abstract.sim_clock import SimClock
from mbf_abstract.transform import Transform
from mbf_abstract.transforms import TransformBuffer


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
