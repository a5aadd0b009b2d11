"""The topics of the node: what it hears from the robot and its users, and the plan and goal that it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command, Path
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.geometry import (
    MessageContext,
    command_twist,
    path_message,
    pose_stamped,
    twist,
    twist_stamped,
)
from mbf_ros.messages.interfaces import MessageError
from mbf_ros.robot_inputs import Input, Quality
from mbf_ros.ros2.conversion import fill, interface_class, to_dict

CMD_VEL = "cmd_vel"
DEPTH = 100
"""How many messages of a topic wait to be taken."""
WARN_PERIOD = 5.0  # s between two warnings about messages of one topic


class CommandTopic:
    """Publishes commands on ``cmd_vel``, as Twist or TwistStamped in the robot's frame."""

    def __init__(
        self, node: Any, stamped: bool, robot_frame: str, clock: Clock, context: Callable[[], MessageContext]
    ) -> None:
        self._class = interface_class("geometry_msgs/TwistStamped" if stamped else "geometry_msgs/Twist")
        self._stamped, self._frame, self._clock, self._context = stamped, robot_frame, clock, context
        self._publisher = node.create_publisher(self._class, CMD_VEL, 10)

    def publish(self, command: Command) -> None:
        """Publish a command; does not wait."""
        value = command_twist(command)
        now = self._clock.now()
        message = twist_stamped(value, self._frame, now, self._context()) if self._stamped else twist(value)
        self._publisher.publish(fill(self._class(), message))

    def wait_until_sent(self, seconds: float) -> None:
        """Wait until all who listen have the last command, for at most ``seconds``."""
        from rclpy.duration import Duration

        self._publisher.wait_for_all_acked(Duration(seconds=seconds))


class Inputs:
    """Subscriptions; a message that means nothing is dropped with a warning."""

    def __init__(self, node: Any) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

        self._node = node
        self._qualities = {
            Quality.SENSOR_DATA: qos_profile_sensor_data,
            Quality.MANY: QoSProfile(depth=DEPTH),
            Quality.LATCHED: QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        }

    def listen(self, inputs: Iterable[Input]) -> None:
        """Subscribe topics."""
        for one in inputs:
            kind, quality = interface_class(one.type), self._qualities[one.quality]
            self._node.create_subscription(kind, one.topic, self._taking(one), quality)

    def _taking(self, one: Input) -> Callable[[Any], None]:
        logger = self._node.get_logger()

        def on_message(message: Any) -> None:
            try:
                one.take(to_dict(message))
            except MessageError as error:
                logger.warning(f"{one.topic}: {error_text(error)}", throttle_duration_sec=WARN_PERIOD)

        return on_message


class Outputs:
    """Publishes the last ``plan`` and ``~/current_goal``, for late subscribers too."""

    def __init__(self, node: Any, navigator: Navigator, context: Callable[[], MessageContext]) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._context, self._action = context, navigator.server.get_path
        self._path_class = interface_class("nav_msgs/Path")
        self._pose_class = interface_class("geometry_msgs/PoseStamped")
        self._plan = node.create_publisher(self._path_class, "plan", latched)
        self._goal = node.create_publisher(self._pose_class, "~/current_goal", latched)
        self._action.listeners.append(self._show_plan)

    def close(self) -> None:
        """Publish no more."""
        self._action.listeners.remove(self._show_plan)

    def show_goal(self, goal: MoveBaseGoal) -> None:
        """Publish where the robot is to go."""
        self._goal.publish(fill(self._pose_class(), pose_stamped(goal.target_pose, self._context())))

    def _show_plan(self, handle: AnyGoalHandle) -> None:
        path: Path | None = handle.result.path if handle.result is not None else None
        if path is not None:
            self._plan.publish(fill(self._path_class(), path_message(path, self._context())))
