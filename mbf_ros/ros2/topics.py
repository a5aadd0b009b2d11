"""The topics of the node: what it hears from the robot and its users, and the plan and goal that it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command, Path
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.geometry import (
    MessageContext,
    command_twist,
    odometry_of,
    path_message,
    pose_of,
    pose_stamped,
    transforms_of,
    twist,
    twist_stamped,
)
from mbf_ros.messages.interfaces import Message, MessageError
from mbf_ros.messages.sensors import SENSORS
from mbf_ros.ros2.conversion import fill, interface_class, to_dict
from mbf_ros.ros2.robot import Arrivals, RosRobot
from mbf_ros.sensor_options import used_sensors

ODOM, TF, TF_STATIC, CMD_VEL = "odom", "/tf", "/tf_static", "cmd_vel"
GOAL_TOPICS = ("goal_pose", "move_base_simple/goal")
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

    def __init__(self, node: Any, clock: Clock, context: Callable[[], MessageContext], arrivals: Arrivals) -> None:
        from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

        self._node, self._clock, self._context, self._arrivals = node, clock, context, arrivals
        self._sensor_data = qos_profile_sensor_data
        self._many = QoSProfile(depth=100)
        self._latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def listen_to_robot(self, robot: RosRobot, transforms: TransformBuffer, uses_odometry: bool) -> None:
        """Take odometry and transforms."""

        def take_odometry(message: Message) -> None:
            robot.take_odometry(odometry_of(message, self._context(), self._clock.now()))
            self._arrivals.hear(ODOM)

        def take_transforms(message: Message, static: bool = False) -> None:
            for transform in transforms_of(message, self._context(), self._clock.now(), static):
                transforms.set(transform)

        if uses_odometry:
            self._arrivals.expect(ODOM)
            self._subscribe(ODOM, "nav_msgs/Odometry", take_odometry, self._sensor_data)
        self._subscribe(TF, "tf2_msgs/TFMessage", take_transforms, self._many)
        self._subscribe(TF_STATIC, "tf2_msgs/TFMessage", lambda one: take_transforms(one, True), self._latched)

    def listen_to_sensors(self, navigator: Navigator, chosen: Mapping[str, tuple[str, str]]) -> None:
        """Feed sensors that a map listens to into it: type of ``sensors.SENSORS`` and source, by topic."""
        used = used_sensors(chosen, navigator.server.listens_to, self._node.get_logger().warning)
        for topic, (kind, source) in used.items():
            take = self._sensor(navigator, topic, kind, source)
            self._subscribe(topic, kind, take, self._sensor_data)

    def listen_to_goals(self, send: Callable[[MoveBaseGoal], AnyGoalHandle], refusal: Callable[[], str]) -> None:
        """Drive to the poses of the goal topics, unless there is a refusal; a newer one takes the older over."""

        def go_to(message: Message) -> None:
            if reason := refusal():
                raise MessageError(reason)
            handle = send(MoveBaseGoal(pose_of(message, self._context(), "goal").stamped(0.0)))
            if handle.done and handle.result is not None:
                raise MessageError(handle.result.message)

        for topic in GOAL_TOPICS:
            self._subscribe(topic, "geometry_msgs/PoseStamped", go_to, self._many)

    def _sensor(self, navigator: Navigator, topic: str, kind: str, source: str) -> Callable[[Message], None]:
        def take(message: Message) -> None:
            navigator.server.take_scan(SENSORS[kind](message, self._context(), source, self._clock.now()))
            self._arrivals.hear(topic)

        return take

    def _subscribe(self, topic: str, type_name: str, take: Callable[[Message], None], quality: Any) -> None:
        logger = self._node.get_logger()

        def on_message(message: Any) -> None:
            try:
                take(to_dict(message))
            except (ValueError, TransformError) as error:
                logger.warning(f"{topic}: {error_text(error)}", throttle_duration_sec=WARN_PERIOD)

        self._node.create_subscription(interface_class(type_name), topic, on_message, quality)


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
