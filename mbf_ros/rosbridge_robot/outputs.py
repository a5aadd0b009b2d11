"""What the robot is sent: commands on one connection; plans and goals, to be shown, on the other."""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.geometry import Command, Twist
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.geometry import MessageContext, command_twist, path_message, pose_stamped, twist, twist_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.navigation import NODE
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge_robot.connection import Connection, NotConnectedError

CMD_VEL, PLAN, GOAL = "/cmd_vel", "/plan", f"{NODE}/current_goal"
SHOWN = {PLAN: "nav_msgs/Path", GOAL: "geometry_msgs/PoseStamped"}


class CommandTopic:
    """Publishes commands as Twist, or as TwistStamped in the robot's frame.

    Only the newest command waits to be sent. What waited when the connection was lost is never sent; on the next one
    zero comes first.
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

    def publish(self, command: Command) -> None:
        """Publish a command; does not wait. Raises NotConnectedError."""
        self._connection().newest(CMD_VEL, self._publication(command))

    def wait_until_sent(self, seconds: float) -> None:
        """Wait until the last command has left, for at most ``seconds``."""
        self._connection().wait_until_sent(seconds)

    def greeting(self) -> list[str]:
        """Return the frames with which each connection begins."""
        kind = "geometry_msgs/TwistStamped" if self._stamped else "geometry_msgs/Twist"
        frames = [frame("advertise", topic=CMD_VEL, type=kind)]
        if self._was_connected:
            frames.append(self._publication(Twist()))
        self._was_connected = True
        return frames

    def _publication(self, command: Command) -> str:
        value, now = command_twist(command), self._clock.now()
        message = twist_stamped(value, self._frame, now, self._context()) if self._stamped else twist(value)
        return frame("publish", topic=CMD_VEL, msg=message)


class ShownTopics:
    """Publishes the last plan and goal, again on each new connection."""

    def __init__(
        self, connection: Callable[[], Connection], navigator: Navigator, context: Callable[[], MessageContext]
    ) -> None:
        self._connection, self._context, self._action = connection, context, navigator.server.get_path
        self._last: dict[str, str] = {}
        self._action.listeners.append(self._show_plan)

    def close(self) -> None:
        """Publish no more."""
        self._action.listeners.remove(self._show_plan)

    def show_goal(self, goal: MoveBaseGoal) -> None:
        """Publish where the robot is to go."""
        self._show(GOAL, pose_stamped(goal.target_pose, self._context()))

    def greeting(self) -> list[str]:
        """Return the frames with which each connection begins."""
        advertised = [frame("advertise", topic=topic, type=kind, latch=True) for topic, kind in SHOWN.items()]
        return [*advertised, *self._last.values()]

    def _show_plan(self, handle: AnyGoalHandle) -> None:
        if handle.result is not None and handle.result.path is not None:
            self._show(PLAN, path_message(handle.result.path, self._context()))

    def _show(self, topic: str, message: Message) -> None:
        self._last[topic] = frame("publish", topic=topic, msg=message)
        try:
            self._connection().newest(topic, self._last[topic])
        except NotConnectedError:
            return  # it is sent when there is a connection again
