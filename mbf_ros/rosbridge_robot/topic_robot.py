"""A robot on the other side of the bridge: it listens to ``/cmd_vel`` and publishes tf, odometry and scans.

When odometry, transforms, or a sensor that was once heard fail to come, zero is sent and no motion until they come
again, see ``ros2.robot``. A stop that the robot cannot hear any more is the robot's own matter: its driver must stop
when commands stop coming.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.geometry import MessageContext, odometry_of, transforms_of
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.ros2.robot import Arrivals, Frames, RosRobot
from mbf_ros.rosbridge.topics import TopicTable

ODOM = "/odom"
WATCH_PERIOD = 0.05  # s between two looks at what fails to come


class TopicRobot:
    """The driver of such a robot.

    Parameters
    ----------
    transforms : TransformBuffer
        Takes ``/tf`` and ``/tf_static``.
    clock : Clock
        A wall clock.
    frames : Frames
    max_silence : callable
        Longest time [s] without a message.
    uses_odometry : bool
        Whether odometry must come.

    Attributes
    ----------
    on_command : list of callables
        Called with each command; must not block.
    """

    def __init__(
        self,
        transforms: TransformBuffer,
        clock: Clock,
        frames: Frames,
        max_silence: Callable[[], float],
        uses_odometry: bool = True,
    ) -> None:
        self.on_command: list[Callable[[Command], None]] = []
        self._transforms, self._now = transforms, clock.now
        self._arrivals = Arrivals(clock.now)
        if uses_odometry:
            self._arrivals.expect(ODOM)
        self._watched = RosRobot(self._publish, transforms, clock, self._arrivals, frames, max_silence)

    def send_command(self, command: Command) -> None:
        """Hand a command on to be published; a motion raises SilenceError while something fails to come."""
        self._watched.send_command(command)

    def odometry(self) -> Odometry:
        """The last odometry; raises SilenceError while something fails to come."""
        return self._watched.odometry()

    def problem(self) -> str:
        """What fails to come; empty if all does."""
        return self._watched.problem()

    def listen(
        self,
        topics: TopicTable,
        context: MessageContext,
        server: AbstractNavigationServer,
        sensors: Mapping[str, tuple[str, str]],
    ) -> None:
        """Take what the robot publishes.

        Parameters
        ----------
        topics : TopicTable
        context : MessageContext
        server : AbstractNavigationServer
            Takes scans; a sensor is missed only where a map of it listens to the sensor's source.
        sensors : mapping of str to (str, str)
            Type of ``sensors.SENSORS``, and source in the configuration, by the topics of the sensors.
        """

        def take_odometry(message: Message) -> None:
            self._watched.take_odometry(odometry_of(message, context, self._now()))
            self._arrivals.hear(ODOM)

        topics.add_input(ODOM, "nav_msgs/Odometry", take_odometry)
        for name, static in (("/tf", False), ("/tf_static", True)):
            topics.add_input(name, "tf2_msgs/TFMessage", partial(self._take_transforms, context, static))
        for name, (kind, source) in sensors.items():
            topics.add_input(name, kind, self._sensor(name, kind, source, context, server))

    def _publish(self, command: Command) -> None:
        for listener in self.on_command:
            listener(command)

    def _take_transforms(self, context: MessageContext, static: bool, message: Message) -> None:
        try:
            for transform in transforms_of(message, context, self._now(), static):
                self._transforms.set(transform)
        except TransformError as error:
            raise MessageError(str(error)) from error

    def _sensor(
        self, name: str, kind: str, source: str, context: MessageContext, server: AbstractNavigationServer
    ) -> Callable[[Message], None]:
        read = SENSORS[kind]

        def take(message: Message) -> None:
            try:
                server.take_scan(read(message, context, source, self._now()))
            except TransformError as error:
                raise MessageError(str(error)) from error
            if server.listens_to(source):
                self._arrivals.hear(name)

        return take
