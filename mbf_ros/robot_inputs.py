"""What comes from a robot and its users, and what takes it: one list for nodes of ROS 2 and both sides of rosbridge.

Topics have the names of ROS 2: one without a leading slash belongs to the namespace of who listens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import partial

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages.floors import floor_of, floor_window_of
from mbf_ros.messages.geometry import MessageContext, initial_pose_of, odometry_of, pose_of, transforms_of
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.ros2.robot import RosRobot

ODOM, TF, TF_STATIC = "odom", "/tf", "/tf_static"
GOALS = ("goal_pose", "move_base_simple/goal")
INITIAL_POSE, INITIAL_POSE_TYPE = "initialpose", "geometry_msgs/PoseWithCovarianceStamped"
Take = Callable[[Message], None]
DEPTH = 100


class Quality(Enum):
    """How messages of a topic travel, where that can be chosen."""

    SENSOR_DATA = "best effort"
    MANY = "reliable"
    LATCHED = "reliable, transient local"


@dataclass(frozen=True)
class Input:
    """A topic that is taken.

    Attributes
    ----------
    taker : callable
        Uses a message; raises ValueError or TransformError where it means nothing, or is refused.
    depth : int
        How many messages wait to be taken; of a map only the newest counts.
    optional : bool
        Whether it is left out where the package of its type is not installed.
    """

    topic: str
    type: str
    quality: Quality
    taker: Take
    depth: int = DEPTH
    optional: bool = False

    def take(self, message: Message) -> None:
        """Take a message; raises MessageError where it means nothing, or is refused."""
        try:
            self.taker(message)
        except (ValueError, TransformError) as error:
            raise MessageError(error_text(error)) from error


@dataclass(frozen=True)
class RobotInputs:
    """The inputs of a navigator.

    Attributes
    ----------
    now : callable
        Our time [s].
    context : callable
        How stamps and frames relate to ours, now.
    hear : callable
        Called with the topic of each odometry and each scan that was taken.
    """

    now: Callable[[], float]
    context: Callable[[], MessageContext]
    hear: Callable[[str], None] = lambda topic: None

    def of_robot(
        self, robot: RosRobot, transforms: TransformBuffer, uses_odometry: bool, odom_topic: str = ODOM
    ) -> Iterator[Input]:
        """Yield odometry, where it is used, and transforms."""

        def take_odometry(message: Message) -> None:
            robot.take_odometry(odometry_of(message, self.context(), self.now()))
            self.hear(odom_topic)

        def take_transforms(message: Message, static: bool = False) -> None:
            for transform in transforms_of(message, self.context(), self.now(), static):
                transforms.set(transform)

        if uses_odometry:
            yield Input(odom_topic, "nav_msgs/Odometry", Quality.SENSOR_DATA, take_odometry)
        yield Input(TF, "tf2_msgs/TFMessage", Quality.MANY, take_transforms)
        yield Input(TF_STATIC, "tf2_msgs/TFMessage", Quality.LATCHED, partial(take_transforms, static=True))

    def of_sensors(
        self, take_scan: Callable[[RangeScan], None], chosen: Mapping[str, tuple[str, str]]
    ) -> Iterator[Input]:
        """Yield sensors that feed a map: type of ``sensors.SENSORS`` and source in the configuration, by topic."""
        for topic, (kind, source) in chosen.items():
            yield Input(topic, kind, Quality.SENSOR_DATA, self._sensor(topic, kind, source, take_scan))

    def of_maps(self, server: AbstractNavigationServer) -> Iterator[Input]:
        """Yield the maps of floors that a server expects, and their changes."""
        for topic in server.map_topics:
            for suffix, kind, quality, read in (
                ("", "nav_msgs/OccupancyGrid", Quality.LATCHED, floor_of),
                ("_updates", "map_msgs/OccupancyGridUpdate", Quality.MANY, floor_window_of),
            ):
                take = partial(self._take_floor, server, topic, read)
                yield Input(topic + suffix, kind, quality, take, depth=DEPTH if suffix else 1, optional=bool(suffix))

    def of_users(
        self, send: Callable[[MoveBaseGoal], AnyGoalHandle], refusal: Callable[[], str] = lambda: ""
    ) -> Iterator[Input]:
        """Yield goals, which are driven to unless there is a refusal; a newer one takes the older one over."""

        def go_to(message: Message) -> None:
            if reason := refusal():
                raise MessageError(reason)
            handle = send(MoveBaseGoal(pose_of(message, self.context(), "goal").stamped(0.0)))
            if handle.done and handle.result is not None:
                raise MessageError(handle.result.message)

        for topic in GOALS:
            yield Input(topic, "geometry_msgs/PoseStamped", Quality.MANY, go_to)

    def of_localization(self, set_initial_pose: Callable[[Pose], None]) -> Iterator[Input]:
        """Yield where somebody says that the robot is, for a robot whose localisation is on this side."""

        def take(message: Message) -> None:
            set_initial_pose(initial_pose_of(message, self.context()))

        yield Input(INITIAL_POSE, INITIAL_POSE_TYPE, Quality.MANY, take)

    def _take_floor(
        self,
        server: AbstractNavigationServer,
        topic: str,
        read: Callable[[Message, MessageContext], FloorMap | FloorWindow],
        message: Message,
    ) -> None:
        server.take_floor(topic, read(message, self.context()))

    def _sensor(self, topic: str, kind: str, source: str, take_scan: Callable[[RangeScan], None]) -> Take:
        def take(message: Message) -> None:
            take_scan(SENSORS[kind](message, self.context(), source, self.now()))
            self.hear(topic)

        return take
