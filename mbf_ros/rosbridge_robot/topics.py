"""What is heard from the robot and its users, and reports of messages that mean nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.sensing import RangeScan
from mbf_ros.messages.geometry import MessageContext, odometry_of, pose_of, transforms_of
from mbf_ros.messages.interfaces import Message, MessageError, completed
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.ros2.robot import Arrivals, RosRobot
from mbf_ros.rosbridge.navigation import GOAL_TOPICS
from mbf_ros.rosbridge.protocol import Operation, absolute, frame, text_in

ODOM, TF, TF_STATIC, CLOCK = "/odom", "/tf", "/tf_static", "/clock"
REPORT_PERIOD = 5.0  # s between two reports about messages of one topic
CLOUDS = "sensor_msgs/PointCloud2"
MAX_SKEW = 1.0  # s; more is not the way here but a calendar that is wrong
BULKY = (CLOUDS, "sensor_msgs/LaserScan")
"""Types with long lists of numbers, and with infinities that JSON cannot say: asked for as CBOR."""


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
    type : str
    throttle : int
        Least time between two messages [ms].
    takers : list of callables
        Raise ValueError or TransformError where a message means nothing.
    """

    type: str
    throttle: int = 0
    takers: list[Callable[[Message], None]] = field(default_factory=list)


class RobotTopics:
    """Subscriptions by topic.

    Parameters
    ----------
    now : callable
        Our time [s].
    context : callable
        How stamps and frames relate to ours, now.
    arrivals : Arrivals
    reports : Reports
    """

    def __init__(
        self,
        now: Callable[[], float],
        context: Callable[[], MessageContext],
        arrivals: Arrivals,
        reports: Reports,
    ) -> None:
        self._now, self._context, self._arrivals, self._reports = now, context, arrivals, reports
        self._subscriptions: dict[str, Subscription] = {}
        self._awaited: list[str] = []

    def listen_to_robot(self, robot: RosRobot, transforms: TransformBuffer, uses_odometry: bool) -> None:
        """Take odometry and transforms."""

        def take_odometry(message: Message) -> None:
            now = self._now()
            odometry = odometry_of(message, self._context(), now)
            robot.take_odometry(odometry)
            self._arrivals.hear(ODOM)
            if abs(ahead := odometry.stamp - now) > MAX_SKEW:
                where = "in the future" if ahead > 0.0 else "in the past"
                raise MessageError(f"it is stamped {abs(ahead):.2f} s {where}; set both calendars (NTP), or see --time")

        def take_transforms(message: Message, static: bool = False) -> None:
            for transform in transforms_of(message, self._context(), self._now(), static):
                transforms.set(transform)

        if uses_odometry:
            self._awaited.append(ODOM)
            self.listen(ODOM, "nav_msgs/Odometry", take_odometry)
        self.listen(TF, "tf2_msgs/TFMessage", take_transforms)
        self.listen(TF_STATIC, "tf2_msgs/TFMessage", lambda one: take_transforms(one, True))
        self.lost()

    def listen_to_sensors(
        self, take_scan: Callable[[RangeScan], None], chosen: Mapping[str, tuple[str, str]], cloud_period: float
    ) -> None:
        """Feed sensors into the map: type of ``sensors.SENSORS`` and source, by topic."""
        for topic, (kind, source) in chosen.items():
            throttle = round(1000.0 * cloud_period) if kind == CLOUDS else 0
            take = self._sensor(absolute(topic), kind, source, take_scan)
            self.listen(absolute(topic), kind, take, throttle)

    def listen_to_goals(self, send: Callable[[MoveBaseGoal], AnyGoalHandle], refusal: Callable[[], str]) -> None:
        """Drive to the poses of the goal topics, unless there is a refusal; a newer one takes the older over."""

        def go_to(message: Message) -> None:
            if reason := refusal():
                raise MessageError(reason)
            handle = send(MoveBaseGoal(pose_of(message, self._context(), "goal").stamped(0.0)))
            if handle.done and handle.result is not None:
                raise MessageError(handle.result.message)

        for topic in GOAL_TOPICS:
            self.listen(topic, "geometry_msgs/PoseStamped", go_to)

    def listen(self, topic: str, type_name: str, take: Callable[[Message], None], throttle: int = 0) -> None:
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
        except (ValueError, TransformError) as error:
            self._reports.bad(topic, error_text(error))

    def lost(self) -> None:
        """Count what the robot must send as silent until it comes again."""
        for topic in self._awaited:
            self._arrivals.expect(topic)

    def _sensor(
        self, topic: str, kind: str, source: str, take_scan: Callable[[RangeScan], None]
    ) -> Callable[[Message], None]:
        def take(message: Message) -> None:
            take_scan(SENSORS[kind](message, self._context(), source, self._now()))
            self._arrivals.hear(topic)
            if topic not in self._awaited:
                self._awaited.append(topic)  # once heard, it is missed

        return take
