"""What the navigator publishes: commands, plans, maps, events, and for a simulated robot also its tf, odometry, scans.

One thread reads the state at a fixed rate and makes the messages that somebody listens to, each once for all of them.
The control loop is not part of it and never waits for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mbf_abstract.geometry import Command
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.ticker import Ticker
from mbf_ros.map_messages import Audience
from mbf_ros.messages.commands import command_message, command_type
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import Message
from mbf_ros.navigator_messages import NavigatorMessages
from mbf_ros.rosbridge.actionlib import ActionlibServer
from mbf_ros.rosbridge.navigation import node_topic
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge.topics import TopicTable
from mbf_ros.rosbridge_robot.robot_state import RobotState

PERIOD = 0.05  # s between two looks at the state
STATUS_PERIOD = 1.0  # s between two lists of actionlib


class Publisher:
    """Publishes the state of a session.

    Parameters
    ----------
    post : callable
        Has a function called on the event loop of the topics.
    actionlib : ActionlibServer
        Gets its turn to send statuses.
    simulated : bool
        Publish tf, odometry and scans too, which else come from the robot.
    stamped_commands : bool
        Publish ``/cmd_vel`` as TwistStamped.
    map_period : float
        Least time between two messages of a map [s].
    problems : callable
        What is wrong with each topic that must come from a robot.
    """

    def __init__(
        self,
        session: NavigationSession,
        topics: TopicTable,
        context: MessageContext,
        post: Callable[..., None],
        actionlib: ActionlibServer,
        simulated: bool,
        stamped_commands: bool = False,
        map_period: float = 1.0,
        problems: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        self._session, self._server = session, session.navigator.server
        self._topics, self._context, self._post, self._actionlib = topics, context, post, actionlib
        self._stamped_commands = stamped_commands
        self._next_status = 0.0
        self._messages = NavigatorMessages(
            session, session.clock, lambda: context, self._audience, problems, map_period, robot_localizes=not simulated
        )
        self._outputs = {one.topic: node_topic(one) for one in self._messages.outputs}
        self._add_topics()
        self._robot_state = RobotState(session, topics, context, self._send) if simulated else None
        self._ticker = Ticker(session.clock, session.events, self._tick, PERIOD, "rosbridge publisher")

    def close(self) -> None:
        """Publish no more."""
        self._ticker.stop()
        self._messages.close()
        if self._robot_state is not None:
            self._robot_state.close()

    def send_command(self, command: Command) -> None:
        """Publish a command at once, for a robot that listens to ``/cmd_vel``; never waits."""
        frame_id, now = self._server.runtime.robot.robot_frame, self._session.clock.now()
        self._send("/cmd_vel", command_message(command, self._stamped_commands, frame_id, now, self._context))

    # -------------------------------------------------------------------------------------------------------
    def _add_topics(self) -> None:
        add = self._topics.add_output
        add("/cmd_vel", command_type(self._stamped_commands))
        for one in self._messages.outputs:
            outdates = self._outputs.get(one.outdates, "")
            add(node_topic(one), one.type, one.always, one.depth, one.shared, outdates)

    def _audience(self, topic: str) -> Audience:
        return Audience(*self._topics.audience(self._outputs[topic]))

    def _tick(self) -> None:
        if self._robot_state is not None:
            self._robot_state.publish()
            self.send_command(self._server.runtime.gate.last_command)
        for topic, message in self._messages.changes():
            self._send(self._outputs[topic], message)
        now = self._session.clock.now()
        if now >= self._next_status:
            self._next_status = now + STATUS_PERIOD
            self._post(self._actionlib.send_status)

    def _send(self, topic: str, message: Message) -> None:
        if self._topics.is_wanted(topic):
            self._post(self._topics.send, topic, frame("publish", topic=topic, msg=message))
