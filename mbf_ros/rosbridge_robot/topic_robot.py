"""A robot on the other side of the bridge: it listens to ``/cmd_vel`` and publishes tf, odometry and scans.

When odometry, transforms, or a sensor that was once heard fail to come, zero is sent and no motion until they come
again, see ``ros2.robot``. A stop that the robot cannot hear any more is the robot's own matter: its driver must stop
when commands stop coming.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mbf_abstract.geometry import Command
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.robot_inputs import ODOM, RobotInputs
from mbf_ros.ros2.robot import Arrivals, Frames, RosRobot
from mbf_ros.rosbridge.protocol import absolute
from mbf_ros.rosbridge.topics import TopicTable

WATCH_PERIOD = 0.02  # s between two looks at what fails to come: less than a control period


class TopicRobot(RosRobot):
    """The driver of such a robot; its ``send_command`` hands a command on to be published.

    Parameters
    ----------
    transforms : TransformBuffer
        Takes ``/tf`` and ``/tf_static``.
    clock : Clock
        A wall clock.
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
        self._uses_odometry, arrivals = uses_odometry, Arrivals(clock.now)
        if uses_odometry:
            arrivals.expect(absolute(ODOM))
        super().__init__(self._hand_on, transforms, clock, arrivals, frames, max_silence)

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
        server : AbstractNavigationServer
            Takes scans; a sensor is missed only where a map of it listens to the sensor's source.
        sensors : mapping of str to (str, str)
            Type of ``sensors.SENSORS``, and source in the configuration, by the topics of the sensors.
        """

        def hear(topic: str) -> None:
            if topic not in sensors or server.listens_to(sensors[topic][1]):
                self._arrivals.hear(absolute(topic))

        inputs = RobotInputs(self._clock.now, lambda: context, hear)
        of_robot = inputs.of_robot(self, self._transforms, self._uses_odometry)
        for one in (*of_robot, *inputs.of_sensors(server.take_scan, sensors)):
            topics.add_input(absolute(one.topic), one.type, one.take)

    def _hand_on(self, command: Command) -> None:
        for listener in self.on_command:
            listener(command)
