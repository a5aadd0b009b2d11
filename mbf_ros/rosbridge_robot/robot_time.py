"""Our clock on the robot's time, which is ROS time: that of the calendar, of the stamps of odometry, or of ``/clock``.

Stamps of odometry serve a robot whose calendar is not ours. A message shows its stamp when it arrives, so the robot's
time is at least that; of the messages of the last while the one with the least delay shows it best. By this estimate no
odometry lies in the future, and all times are too early by the least delay of the network. When the robot's calendar
is set, messages go on to contradict the estimate, and it begins anew with them; one alone is a bad stamp.
"""

from __future__ import annotations

import threading
from collections import deque

from mbf_abstract.time.clock import Clock, unix_seconds
from mbf_ros.messages.geometry import NANOSECONDS
from mbf_ros.messages.interfaces import Message
from mbf_ros.robot_inputs import ODOM
from mbf_ros.ros2.clock import JUMP, RosClock, SimulatedRosClock
from mbf_ros.ros2.robot import Arrivals
from mbf_ros.rosbridge.protocol import absolute
from mbf_ros.rosbridge_robot.options import TimeSource
from mbf_ros.rosbridge_robot.topics import RobotTopics

CLOCK = "/clock"
CONTRADICTIONS = 3
"""How many messages in a row must agree, and differ from the estimate by more than ``JUMP``, to replace it."""
CONTRADICTION_TIME = 0.5
"""Least time [s] over which they must arrive; those that a network has held back arrive together."""
WINDOW = 10.0
"""Time [s] for which a message counts; clocks of computers drift apart by less than a millisecond meanwhile."""


class LeastDelay:
    """The greatest difference of stamp and arrival within a sliding window of time.

    Parameters
    ----------
    window : float
        Its length [s].
    """

    def __init__(self, window: float = WINDOW) -> None:
        self._window = window
        self._best: deque[tuple[float, float]] = deque()  # arrivals rise, differences fall
        self._contradicting: list[tuple[float, float]] = []

    def add(self, stamp: float, arrival: float) -> float:
        """Take a message, in the order of arrival; returns the sender's time minus ours [s]."""
        difference = stamp - arrival
        if not self._best or abs(difference - self._best[0][1]) <= JUMP:
            self._contradicting.clear()
            self._take(arrival, difference)
            return self._best[0][1]
        agreeing = [one for one in self._contradicting if abs(one[1] - difference) <= JUMP]
        self._contradicting = [*agreeing, (arrival, difference)]
        if len(agreeing) >= CONTRADICTIONS - 1 and arrival - agreeing[0][0] >= CONTRADICTION_TIME:
            self._best.clear()
            for one in self._contradicting:
                self._take(*one)
            self._contradicting.clear()
        return self._best[0][1]

    def _take(self, arrival: float, difference: float) -> None:
        while self._best and self._best[-1][1] <= difference:
            self._best.pop()
        self._best.append((arrival, difference))
        while self._best[0][0] < arrival - self._window:
            self._best.popleft()


class RobotTime:
    """Makes the clock, and lets it follow the robot's time.

    Parameters
    ----------
    real_time : Clock
        When messages arrive.
    arrivals : Arrivals
        Learns of ``/clock``.
    """

    def __init__(self, source: TimeSource, real_time: Clock, arrivals: Arrivals) -> None:
        self.source = source
        self._real_time, self._arrivals = real_time, arrivals
        self._clock: RosClock | None = RosClock(unix_seconds()) if source is TimeSource.CALENDAR else None
        self._least_delay = LeastDelay()
        self._came = threading.Event()

    def listen(self, topics: RobotTopics) -> None:
        """Take the messages that show the time, if any do."""
        if self.source is TimeSource.SIMULATED:
            topics.listen(CLOCK, "rosgraph_msgs/Clock", self._take_clock)
        elif self.source is TimeSource.ODOM:
            topics.listen(absolute(ODOM), "nav_msgs/Odometry", self._take_odometry)

    def clock(self, seconds: float) -> RosClock | None:
        """Return the clock once the time is known; None where it is not within ``seconds``."""
        if self._clock is None:
            self._came.wait(seconds)
        return self._clock

    def follow_calendar(self) -> None:
        """Follow the calendar where it shows the robot's time; to be called often."""
        if self.source is TimeSource.CALENDAR and self._clock is not None:
            self._clock.follow(unix_seconds())

    def _take_clock(self, message: Message) -> None:
        self._follow(_seconds(message["clock"]), SimulatedRosClock)
        self._arrivals.hear(CLOCK)

    def _take_odometry(self, message: Message) -> None:
        stamp, arrival = _seconds(message["header"]["stamp"]), self._real_time.now()
        if stamp:
            self._follow(self._least_delay.add(stamp, arrival) + arrival, RosClock)

    def _follow(self, ros_time: float, kind: type[RosClock]) -> None:
        if self._clock is None:
            self._clock = kind(ros_time)
            self._came.set()
        self._clock.follow(ros_time)


def _seconds(time: Message) -> float:
    """A builtin_interfaces/Time in seconds."""
    return float(time["sec"] + time["nanosec"] / NANOSECONDS)
