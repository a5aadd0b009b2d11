"""A robot's driver is checked when the server is made."""

import threading

import numpy as np
import pytest

from mbf_abstract.drive.driver_check import DriverError, check_driver
from mbf_abstract.drive.robot import Odometry, turning_radius_of
from mbf_abstract.geometry import Twist
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.sim_clock import SimClock


class Good:
    """A driver without odometry; the bad ones replace one of its methods."""

    def send_command(self, command):
        """Stay."""

    def odometry(self):
        return None


class AsyncSend(Good):
    async def send_command(self, command):
        pass


class AsyncOdometry(Good):
    async def odometry(self):
        pass


class HiddenAsyncOdometry(Good):
    def odometry(self):
        return AsyncOdometry().odometry()


class NoArgument(Good):
    def send_command(self):
        pass


class TupleOdometry(Good):
    def odometry(self):
        return (0.5, 0.0, 0.1)


class TupleVelocity(Good):
    def odometry(self):
        return Odometry((0.5, 0.0, 0.1), 0.0)


class NoRadius(Good):
    min_turning_radius = "tight"


class NegativeRadius(Good):
    min_turning_radius = -1.0


class NoOdometry:
    def send_command(self, command):
        pass


class NumberForMethod(Good):
    odometry = 3


@pytest.mark.parametrize(
    ("robot", "text"),
    [
        (object(), "object is not a robot driver: send_command is missing"),
        (None, "NoneType is not a robot driver: send_command is missing"),
        (LoopbackRobot, "must be a driver object, got the class LoopbackRobot"),
        (NoOdometry(), "odometry is missing"),
        (NumberForMethod(), "odometry is int, expected a method"),
        (NoArgument(), "send_command must take 1 argument"),
        (AsyncSend(), "send_command is a coroutine function"),
        (AsyncOdometry(), "odometry is a coroutine function"),
        (HiddenAsyncOdometry(), "answered with coroutine, expected Odometry or None"),
        (TupleOdometry(), "answered with tuple, expected Odometry or None"),
        (TupleVelocity(), "holds tuple, expected Twist"),
        (NoRadius(), "min_turning_radius is 'tight', expected a length in m"),
        (NegativeRadius(), "min_turning_radius is -1.0"),
    ],
)
@pytest.mark.parametrize("clock", [SimClock, WallClock])
def test_what_is_no_driver_is_refused(robot, text, clock):
    with pytest.raises(DriverError, match=text):
        check_driver(robot, clock())


def test_a_server_with_what_is_no_driver_is_not_made():
    clock = SimClock()
    with pytest.raises(DriverError, match="send_command is missing"):
        ScriptedSession(clock=clock, robot=object())
    assert set(clock.thread_names) == {"main"}


@pytest.mark.parametrize("radius", [2, np.int64(2), np.float32(2.0), np.float64(2.0)])
def test_a_driver_may_give_its_tightest_curve_as_any_real_number(radius):
    robot = Good()
    robot.min_turning_radius = radius
    check_driver(robot, SimClock())
    assert turning_radius_of(robot) == 2.0


@pytest.mark.parametrize("answer", [None, Odometry(Twist(), 0.0), OSError("not connected yet")])
def test_a_driver_that_answers_or_is_not_connected_yet_is_accepted(answer):
    class Robot(Good):
        def odometry(self):
            if isinstance(answer, Exception):
                raise answer
            return answer

    check_driver(Robot(), SimClock())


def test_odometry_that_blocks_does_not_block_the_making_of_the_server():
    blocked = threading.Event()

    class Robot(Good):
        def odometry(self):
            blocked.wait()

    check_driver(Robot(), WallClock())
    blocked.set()
