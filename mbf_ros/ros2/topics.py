"""The topics of the node: what it hears from the robot and its users, and what it shows of the navigator."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock, WallClock
from mbf_abstract.time.ticker import Ticker
from mbf_ros.map_messages import Audience, Output
from mbf_ros.messages.cdr import serialized
from mbf_ros.messages.commands import STAMPED, command_message, command_type
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import MessageError
from mbf_ros.navigator_messages import NavigatorMessages
from mbf_ros.robot_inputs import Input, Quality
from mbf_ros.ros2.conversion import MissingInterfaceError, fill, interface_class, to_dict

CMD_VEL, OWN_CMD_VEL = "cmd_vel", "~/cmd_vel"
PERIOD = 0.05  # s between two looks at what is new
WARN_PERIOD = 5.0  # s between two warnings about messages of one topic


class CommandTopic:
    """Publishes commands on ``cmd_vel``, as Twist or TwistStamped in the robot's frame.

    As Move Base Flex does, also on ``~/cmd_vel``, always as TwistStamped; where somebody listens.
    """

    def __init__(
        self, node: Any, stamped: bool, robot_frame: str, clock: Clock, context: Callable[[], MessageContext]
    ) -> None:
        self._class, self._stamped_class = interface_class(command_type(stamped)), interface_class(STAMPED)
        self._stamped = stamped
        self._frame, self._clock, self._context = robot_frame, clock, context
        self._publisher = node.create_publisher(self._class, CMD_VEL, 10)
        self._own = node.create_publisher(self._stamped_class, OWN_CMD_VEL, 10)

    def publish(self, command: Command) -> None:
        """Publish a command; does not wait."""
        now, context = self._clock.now(), self._context()
        self._publisher.publish(fill(self._class(), command_message(command, self._stamped, self._frame, now, context)))
        if self._own.get_subscription_count():
            self._own.publish(fill(self._stamped_class(), command_message(command, True, self._frame, now, context)))

    def wait_until_sent(self, seconds: float) -> None:
        """Wait until all who listen have the last command, for at most ``seconds``."""
        from rclpy.duration import Duration

        for publisher in (self._publisher, self._own):
            publisher.wait_for_all_acked(Duration(seconds=seconds))


def profile(quality: Quality, depth: int) -> Any:
    """Return the QoS profile of a topic on which ``depth`` messages may wait."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

    if quality is Quality.SENSOR_DATA:
        return qos_profile_sensor_data
    latched = quality is Quality.LATCHED
    return QoSProfile(
        depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    )


class Inputs:
    """Subscriptions; a message that means nothing is dropped with a warning."""

    def __init__(self, node: Any) -> None:
        self._node = node

    def listen(self, inputs: Iterable[Input]) -> None:
        """Subscribe topics."""
        for one in inputs:
            try:
                kind = interface_class(one.type)
            except MissingInterfaceError as error:
                if not one.optional:
                    raise
                self._node.get_logger().info(f"{one.topic} is not subscribed to: {error}")
                continue
            self._node.create_subscription(kind, one.topic, self._taking(one), profile(one.quality, one.depth))

    def _taking(self, one: Input) -> Callable[[Any], None]:
        logger = self._node.get_logger()

        def on_message(message: Any) -> None:
            try:
                one.take(to_dict(message))
            except MessageError as error:
                logger.warning(f"{one.topic}: {error_text(error)}", throttle_duration_sec=WARN_PERIOD)

        return on_message


class Outputs:
    """Publishes what is new of a navigator, on a thread of its own; nothing but plan and goal if nobody listens.

    Parameters
    ----------
    context : callable
        How stamps and frames relate to ours, now.
    problems : callable
        What is wrong with each topic that must come.
    map_period : float
        Least time [s] between two messages of a map.
    """

    def __init__(
        self,
        node: Any,
        session: NavigationSession,
        real_time: WallClock,
        context: Callable[[], MessageContext],
        problems: Callable[[], Mapping[str, str]],
        map_period: float,
    ) -> None:
        self._node = node
        self._messages = NavigatorMessages(
            session, real_time, context, self._audience, problems, map_period, robot_localizes=True
        )
        made = ((one, self._made(one)) for one in self._messages.outputs)
        self._publishers = {one.topic: (one.type, publisher) for one, publisher in made if publisher is not None}
        self._audiences = dict.fromkeys(self._publishers, Audience(0, 0))
        self._ticker = Ticker(real_time, session.events, self._publish, PERIOD, "ros publisher")

    def close(self) -> None:
        """Publish no more."""
        self._ticker.stop()
        self._messages.close()

    def _made(self, one: Output) -> Any:
        """The publisher of a topic; None where the package of its messages is not installed."""
        try:
            kind = interface_class(one.type)
        except MissingInterfaceError as error:
            self._node.get_logger().info(f"{one.topic} is not published: {error}")
            return None
        return self._node.create_publisher(kind, one.topic, profile(one.quality, one.depth))

    def _audience(self, topic: str) -> Audience:
        if topic not in self._publishers:
            return Audience(0, 0)
        count, before = self._publishers[topic][1].get_subscription_count(), self._audiences[topic]
        self._audiences[topic] = Audience(count, before.joined + (count > before.listeners))
        return self._audiences[topic]

    def _publish(self) -> None:
        for topic, message in self._messages.changes():
            type_name, publisher = self._publishers[topic]
            publisher.publish(serialized(type_name, message))
