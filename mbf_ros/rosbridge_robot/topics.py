"""What is heard from the robot and its users, and reports of messages that mean nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from mbf_abstract.event_values import error_text
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message, MessageError, completed
from mbf_ros.robot_inputs import ODOM, Input, Take
from mbf_ros.ros2.robot import Arrivals
from mbf_ros.rosbridge.protocol import Operation, absolute, frame, text_in

REPORT_PERIOD = 5.0  # s between two reports about messages of one topic
CLOUDS = "sensor_msgs/PointCloud2"
MAX_SKEW = 1.0  # s; more is not the network but a calendar that is wrong
BULKY = (CLOUDS, "sensor_msgs/LaserScan", "nav_msgs/OccupancyGrid", "map_msgs/OccupancyGridUpdate")
"""Types with long lists of numbers, some with infinities that JSON cannot say: asked for as CBOR."""


class Reports:
    """Reports of bad messages: the first of a topic at once, then one for all that come within ``REPORT_PERIOD``."""

    def __init__(self, now: Callable[[], float], report: Callable[[str], None]) -> None:
        self._now, self._report = now, report
        self._last: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def bad(self, topic: str, problem: str) -> None:
        """Report a message, or count it for the next report."""
        now = self._now()
        if topic in self._last and now - self._last[topic] < REPORT_PERIOD:
            self._held[topic] = self._held.get(topic, 0) + 1
            return
        more = self._held.pop(topic, 0)
        self._last[topic] = now
        self._report(f"{topic}: {problem}" + (f" (and {more} more since the last report)" if more else ""))


@dataclass(frozen=True)
class Subscription:
    """What takes the messages of a topic, and how they are asked for.

    Attributes
    ----------
    throttle : int
        Least time between two messages [ms].
    takers : list of callables
        Raise MessageError where a message means nothing.
    """

    type: str
    throttle: int = 0
    takers: list[Take] = field(default_factory=list)


class RobotTopics:
    """Subscriptions by topic.

    Parameters
    ----------
    now : callable
        Our time [s].
    context : callable
        How stamps and frames relate to ours, now.
    """

    def __init__(
        self, now: Callable[[], float], context: Callable[[], MessageContext], arrivals: Arrivals, reports: Reports
    ) -> None:
        self._now, self._context, self._arrivals, self._reports = now, context, arrivals, reports
        self._subscriptions: dict[str, Subscription] = {}
        self._awaited: list[str] = []

    def listen_to(self, inputs: Iterable[Input], cloud_period: float = 0.0) -> None:
        """Take topics; odometry must come, and of clouds the robot is asked for one in ``cloud_period`` [s] at most."""
        for one in inputs:
            topic, throttle = absolute(one.topic), round(1000.0 * cloud_period) if one.type == CLOUDS else 0
            self.listen(topic, one.type, one.take, throttle)
            if one.topic == ODOM:
                self.listen(topic, one.type, self._check_calendars)
                self._awaited.append(topic)
                self._arrivals.expect(topic)

    def listen(self, topic: str, type_name: str, take: Take, throttle: int = 0) -> None:
        """Take the messages of a topic, after those who take them already."""
        self._subscriptions.setdefault(topic, Subscription(type_name, throttle)).takers.append(take)

    def requests(self) -> list[str]:
        """Return the frames that subscribe all topics."""
        return [
            frame(
                "subscribe",
                topic=topic,
                type=one.type,
                throttle_rate=one.throttle,
                queue_length=1 if one.throttle else 0,
                compression="cbor" if one.type in BULKY else "none",
            )
            for topic, one in tuple(self._subscriptions.items())  # more may be added on another thread
        ]

    def take(self, operation: Operation) -> None:
        """Take a message that was published; one that means nothing is reported and dropped."""
        topic = absolute(text_in(operation, "topic"))
        subscription = self._subscriptions.get(topic)
        if subscription is None:
            return
        try:
            message = completed(subscription.type, operation.get("msg", {}))
            for take in subscription.takers:
                take(message)
        except MessageError as error:
            self._reports.bad(topic, error_text(error))

    def hear(self, topic: str) -> None:
        """Note that a message has come; once heard, a topic is missed."""
        name = absolute(topic)
        self._arrivals.hear(name)
        if name not in self._awaited:
            self._awaited.append(name)

    def lost(self) -> None:
        """Count what the robot must send as silent until it comes again."""
        for topic in self._awaited:
            self._arrivals.expect(topic)

    def _check_calendars(self, message: Message) -> None:
        """Raise MessageError where the stamp of an odometry shows that a calendar is wrong."""
        stamp = self._context().stamp(message["header"]["stamp"])
        ahead = stamp - self._now() if stamp else 0.0
        if abs(ahead) > MAX_SKEW:
            where = "in the future" if ahead > 0.0 else "in the past"
            raise MessageError(f"it is stamped {abs(ahead):.2f} s {where}; set both calendars (NTP), or see --time")
