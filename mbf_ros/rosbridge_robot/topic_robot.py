"""A robot on the other side of the bridge: it listens to ``/cmd_vel`` and publishes tf, odometry and scans.

When its client falls silent, transforms and odometry grow old, and the goal ends with TF_ERROR, the robot stopped. A
stop that the robot cannot hear any more is the robot's own matter: its driver must stop when commands stop coming.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_ros.messages.geometry import MessageContext, odometry_of, transforms_of
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.rosbridge.topics import TopicTable


class TopicRobot:
    """The driver of such a robot.

    Parameters
    ----------
    transforms : TransformBuffer
        Takes ``/tf`` and ``/tf_static``.
    now : callable
        Our time [s].

    Attributes
    ----------
    on_command : list of callables
        Called with each command; must not block.
    """

    def __init__(self, transforms: TransformBuffer, now: Callable[[], float]) -> None:
        self.on_command: list[Callable[[Command], None]] = []
        self._transforms, self._now = transforms, now
        self._odometry: Odometry | None = None

    def send_command(self, command: Command) -> None:
        """Hand a command on to be published."""
        for listener in self.on_command:
            listener(command)

    def odometry(self) -> Odometry:
        """The last odometry; raises RuntimeError before the first, as the velocity is unknown until then."""
        if self._odometry is None:
            raise RuntimeError("no message has come on /odom yet")
        return self._odometry

    def listen(
        self,
        topics: TopicTable,
        context: MessageContext,
        take_scan: Callable[[RangeScan], None],
        sensors: Mapping[str, tuple[str, str]],
    ) -> None:
        """Take what the robot publishes.

        Parameters
        ----------
        topics : TopicTable
        context : MessageContext
        take_scan : callable
            Of the server.
        sensors : mapping of str to (str, str)
            Type of ``sensors.SENSORS``, and source in the configuration, by the topics of the sensors.
        """

        def take_odometry(message: Message) -> None:
            self._odometry = odometry_of(message, context, self._now())

        topics.add_input("/odom", "nav_msgs/Odometry", take_odometry)
        for name, static in (("/tf", False), ("/tf_static", True)):
            topics.add_input(name, "tf2_msgs/TFMessage", partial(self._take_transforms, context, static))
        for name, (kind, source) in sensors.items():
            topics.add_input(name, kind, self._sensor(kind, source, context, take_scan))

    def _take_transforms(self, context: MessageContext, static: bool, message: Message) -> None:
        try:
            for transform in transforms_of(message, context, self._now(), static):
                self._transforms.set(transform)
        except TransformError as error:
            raise MessageError(str(error)) from error

    def _sensor(
        self, kind: str, source: str, context: MessageContext, take_scan: Callable[[RangeScan], None]
    ) -> Callable[[Message], None]:
        read = SENSORS[kind]

        def take(message: Message) -> None:
            try:
                take_scan(read(message, context, source, self._now()))
            except TransformError as error:
                raise MessageError(str(error)) from error

        return take
