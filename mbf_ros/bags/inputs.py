"""Messages of a bag on their way to the transform buffer, the robot and the layers, counted on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.geometry.transform_problems import MAX_LEAD
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.server.map_server import MapServer
from mbf_ros.bags.reading import Bag, Recorded
from mbf_ros.bags.recorded_time import RecordedTime
from mbf_ros.bags.statistics import FrameStatistics, TopicStatistics, reason_of
from mbf_ros.bags.topics import BagTopics
from mbf_ros.messages.geometry import MessageContext, odometry_of, quaternion_of, transforms_of, vector_of
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.robot_inputs import Input

FROM_FUTURE = "stamped in the future"


class RecordedRobot:
    """The robot of a bag: its odometry is what was recorded last, and commands to it are a mistake of the caller."""

    def __init__(self) -> None:
        self.last: Odometry | None = None

    def send_command(self, command: Command) -> None:
        """Do nothing: what was recorded cannot be steered."""

    def odometry(self) -> Odometry | None:
        """The last odometry; None before the first one."""
        return self.last


def odometry_transform(message: Message, context: MessageContext, stamp: float, robot_frame: str) -> Transform:
    """The pose of odometry as a transform; ``robot_frame`` is meant where it names no frame of the robot."""
    body, parent = message["pose"]["pose"], context.frame(message["header"]["frame_id"])
    child = message["child_frame_id"].lstrip("/") or robot_frame
    return Transform(vector_of(body["position"]), quaternion_of(body["orientation"]), parent, child, stamp)


class BagInputs:
    """Takes the messages of a bag, each at its time.

    Parameters
    ----------
    server : MapServer
        Its transform buffer and its maps are fed.
    odometry_as_transform : bool
        Take the poses of odometry for the transform from its frame to its child frame.

    Attributes
    ----------
    frames : dict of str to FrameStatistics
        By child frame.
    scan_listeners : list of callables
        Called with each scan that a map has taken.
    """

    def __init__(
        self,
        bag: Bag,
        topics: BagTopics,
        time: RecordedTime,
        server: MapServer,
        robot: RecordedRobot,
        odometry_as_transform: bool,
    ) -> None:
        self.topics = {topic: TopicStatistics(kind, topics.used_as(topic)) for topic, kind in sorted(bag.types.items())}
        self.frames: dict[str, FrameStatistics] = {}
        self.scan_listeners: list[Callable[[RangeScan], None]] = []
        self._bag, self._time, self._server, self._robot = bag, time, server, robot
        self._odometry_as_transform = odometry_as_transform
        self._take: dict[str, Callable[[TopicStatistics, Message, float], None]] = {
            topics.transforms: self._take_transforms,
            topics.static: self._take_static,
            topics.odometry: self._take_odometry,
            **{topic: partial(self._take_scan, *sensor) for topic, sensor in topics.sensors.items()},
            **{topic: partial(self._take_floor, one) for topic, one in topics.maps.items()},
        }
        for topic, statistics in self.topics.items():
            if statistics.used_as:
                bag.require(topic)

    def take(self, recorded: Recorded, now: float) -> None:
        """Count a message that was recorded at our time ``now`` [s], and hand it on; one that is no use is counted."""
        statistics = self.topics[recorded.topic]
        statistics.recorded.take(now - self._time.began)
        if not statistics.used_as:
            return
        try:
            self._take[recorded.topic](statistics, self._bag.decode(recorded), now)
        except (ValueError, TransformError) as error:
            statistics.drop(reason_of(error), error_text(error))

    @property
    def _context(self) -> MessageContext:
        return self._time.context

    @property
    def _transforms(self) -> TransformBuffer:
        return self._server.runtime.transforms

    def _take_transforms(self, statistics: TopicStatistics, message: Message, now: float) -> None:
        for transform in transforms_of(message, self._context, now):
            self._set(statistics, transform, now)

    def _take_static(self, statistics: TopicStatistics, message: Message, now: float) -> None:
        for transform in transforms_of(message, self._context, now, static=True):
            self._set(statistics, transform, now)

    def _take_odometry(self, statistics: TopicStatistics, message: Message, now: float) -> None:
        self._robot.last = odometry_of(message, self._context, now)
        if self._odometry_as_transform:
            robot_frame, stamp = self._server.runtime.robot.robot_frame, self._robot.last.stamp
            self._set(statistics, odometry_transform(message, self._context, stamp, robot_frame), now)
        else:
            statistics.delays.take(now - self._robot.last.stamp)

    def _set(self, statistics: TopicStatistics, transform: Transform, now: float) -> None:
        """Give the buffer a transform, and count it; the buffer ignores one from the future."""
        seen = replace(transform, stamp=transform.stamp - self._time.began)
        self.frames.setdefault(transform.child, FrameStatistics(transform.parent)).take(seen, now - self._time.began)
        if not transform.static:
            statistics.delays.take(now - transform.stamp)
            if transform.stamp > now + MAX_LEAD:
                text = f"{transform.parent}->{transform.child} is {transform.stamp - now:.3f} s ahead"
                statistics.drop(FROM_FUTURE, text)
        self._transforms.set(transform)

    def _take_scan(self, kind: str, source: str, statistics: TopicStatistics, message: Message, now: float) -> None:
        scan = SENSORS[kind](message, self._context, source, now)
        statistics.delays.take(now - scan.stamp)
        is_by_newest, refusals = self._judge(scan)
        self._server.take_scan(scan)  # raises where all maps refuse
        statistics.placed_by_newest += is_by_newest
        for name, error in refusals.items():
            statistics.drop_by_map(name, reason_of(error), error_text(error))
        for listener in self.scan_listeners:
            listener(scan)

    def _take_floor(self, taken: Input, statistics: TopicStatistics, message: Message, now: float) -> None:
        taken.take(message)

    def _judge(self, scan: RangeScan) -> tuple[bool, dict[str, TransformError]]:
        """Whether a map will place a scan by the newest transform, and why maps will refuse it, by their names."""
        is_by_newest, refusals = False, {}
        for name, served in self._server.served.items():
            if not served.map.listens_to(scan.source):
                continue
            try:
                transform = scan.transform_to(served.map.frame_id, self._transforms, served.transform_tolerance)
                is_by_newest |= transform.stamp != scan.stamp
            except TransformError as error:
                refusals[name] = error
        return is_by_newest, refusals
