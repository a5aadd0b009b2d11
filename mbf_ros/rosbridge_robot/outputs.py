"""What the robot is sent: commands on one connection; on the other what is to be shown of the navigator."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress

from mbf_abstract.drive.commands import stands_still
from mbf_abstract.geometry import Command, Twist
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock
from mbf_abstract.time.ticker import Ticker
from mbf_ros.map_messages import Audience
from mbf_ros.messages.commands import command_message, command_type
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.navigator_messages import DIAGNOSTICS, FOOTPRINT, GOAL, LOCAL_PLAN, LOCALIZATION, PLAN, NavigatorMessages
from mbf_ros.rosbridge.navigation import node_topic
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge_robot.connection import Connection, NotConnectedError

CMD_VEL = "/cmd_vel"
PERIOD = 0.1  # s between two looks at what is new
ZERO_PERIOD = 0.5  # s between two zeros after a connection was opened anew
SETTLING_TIME = 10.0
"""Time [s] for which they are repeated once all that the robot must send has come again."""
LONGEST_SETTLING = 60.0
"""Longest time [s] for which they are repeated: somebody else may have to drive a robot that sends nothing."""
SHOWN = (PLAN, GOAL, LOCAL_PLAN, FOOTPRINT, DIAGNOSTICS, LOCALIZATION)
"""What is published although nobody is known to listen; maps would fill the connection."""


class CommandTopic:
    """Publishes commands as Twist, or as TwistStamped in the robot's frame.

    Only the newest command waits to be sent. What waited when the connection was lost is never sent; on the next one
    zero comes first. Who listens on the robot learns of a server that has started anew only after a while, and until
    then hears nothing; so zero is to be repeated, see ``repeat_zero``.
    """

    def __init__(
        self,
        connection: Callable[[], Connection],
        stamped: bool,
        robot_frame: str,
        clock: Clock,
        context: Callable[[], MessageContext],
    ) -> None:
        self._connection, self._clock, self._context = connection, clock, context
        self._stamped, self._frame, self._was_connected = stamped, robot_frame, False
        self._lock = threading.Lock()
        self._is_moving = False

    def publish(self, command: Command) -> None:
        """Publish a command; does not wait. Raises NotConnectedError."""
        with self._lock:
            self._is_moving = not stands_still(command)
            self._connection().newest(CMD_VEL, self._publication(command))

    def repeat_zero(self) -> None:
        """Publish zero once more, unless the last command was a motion; does not wait. Raises NotConnectedError."""
        with self._lock:
            if not self._is_moving:
                self._connection().newest(CMD_VEL, self._publication(Twist()))

    def wait_until_sent(self, seconds: float) -> None:
        """Wait until the last command has left, for at most ``seconds``."""
        self._connection().wait_until_sent(seconds)

    def greeting(self) -> list[str]:
        """Return the frames with which each connection begins."""
        frames = [frame("advertise", topic=CMD_VEL, type=command_type(self._stamped))]
        if self._was_connected:
            frames.append(self._publication(Twist()))
        self._was_connected = True
        return frames

    def _publication(self, command: Command) -> str:
        now, context = self._clock.now(), self._context()
        return frame("publish", topic=CMD_VEL, msg=command_message(command, self._stamped, self._frame, now, context))


class Settling:
    """When to repeat zero after a connection was opened anew.

    Parameters
    ----------
    now : callable
        Real time [s].
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._end = self._longest = self._due = -math.inf

    def begin(self) -> None:
        """Begin: a connection was opened."""
        self._due = self._now()
        self._end, self._longest = self._due + SETTLING_TIME, self._due + LONGEST_SETTLING

    def is_due(self, is_heard: bool) -> bool:
        """Whether to repeat zero now; ``is_heard``: all that the robot must send comes. To be called often."""
        now = self._now()
        if now >= min(self._end, self._longest):
            return False
        if not is_heard:
            self._end = now + SETTLING_TIME
        if now < self._due:
            return False
        self._due = now + ZERO_PERIOD
        return True


class ShownTopics:
    """Publishes what is small of a navigator, on a thread of its own; plan and goal again on each new connection."""

    def __init__(
        self,
        connection: Callable[[], Connection],
        session: NavigationSession,
        real_time: Clock,
        context: Callable[[], MessageContext],
        problems: Callable[[], Mapping[str, str]],
    ) -> None:
        self._connection = connection
        self._messages = NavigatorMessages(session, real_time, context, _audience, problems, robot_localizes=True)
        self._last: dict[str, str] = {}
        self._session, self._real_time = session, real_time
        self._ticker: Ticker | None = None

    def begin(self) -> None:
        """Publish from now on; the greeting has to be sent before, as it advertises the topics."""
        self._ticker = Ticker(self._real_time, self._session.events, self._publish, PERIOD, "robot link publisher")

    def close(self) -> None:
        """Publish no more."""
        if self._ticker is not None:
            self._ticker.stop()
        self._messages.close()

    def greeting(self) -> list[str]:
        """Return the frames with which each connection begins."""
        advertised = [frame("advertise", topic=node_topic(one), type=one.type, latch=one.always) for one in SHOWN]
        return [*advertised, *tuple(self._last.values())]

    def _publish(self) -> None:
        shown = {one.topic: one for one in SHOWN}
        for topic, message in self._messages.changes():
            text = frame("publish", topic=node_topic(shown[topic]), msg=message)
            if shown[topic].always:
                self._last[topic] = text
            with suppress(NotConnectedError):  # plan and goal are sent when there is a connection again
                self._connection().newest(node_topic(shown[topic]), text)


def _audience(topic: str) -> Audience:
    return Audience(int(any(topic == one.topic for one in SHOWN)), 0)
