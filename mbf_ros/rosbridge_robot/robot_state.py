"""What a simulated robot publishes on the topics of a rosbridge server."""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.session import NavigationSession
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.robot_messages import TF_STATIC, RobotMessages, state_topics
from mbf_ros.rosbridge.topics import TopicTable


class RobotState:
    """Publishes the state of a robot when it is asked to.

    Parameters
    ----------
    session : NavigationSession
        Knows the robot, its sensors and its transforms.
    send : callable
        Publishes a message on a topic.
    """

    def __init__(
        self,
        session: NavigationSession,
        topics: TopicTable,
        context: MessageContext,
        send: Callable[[str, Message], None],
    ) -> None:
        self._send = send
        self._messages = RobotMessages(session, context, topics.is_wanted)
        for name, kind in state_topics(session.sensor_mounts).items():
            topics.add_output(name, kind, latched=name == TF_STATIC)

    def close(self) -> None:
        """Take no more scans."""
        self._messages.close()

    def publish(self) -> None:
        """Publish what is new."""
        for topic, message in self._messages.changes():
            self._send(topic, message)
