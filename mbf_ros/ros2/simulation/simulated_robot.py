"""The robot of a simulation as a node of ROS 2: it publishes time and its state, and takes ``cmd_vel``.

On ``initialpose`` its localisation is given where the robot is.

The node has no thread that publishes: the simulation asks for that after each step, so that time, transforms and
scans leave together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command, Pose
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock, WallClock
from mbf_ros.messages.commands import command_of, command_type
from mbf_ros.messages.geometry import InvalidValueError, MessageContext, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.robot_inputs import INITIAL_POSE_TYPE, RobotInputs
from mbf_ros.robot_messages import SENSOR_TOPICS, STATE_TOPICS, TF, TF_STATIC, RobotMessages, state_topics
from mbf_ros.ros2.conversion import fill, interface_class, to_dict
from mbf_ros.ros2.running import RosError, Spinner, require_ros_2, ros_2
from mbf_ros.ros2.topics import Inputs

NODE = "simulator"
CLOCK, CMD_VEL, GOAL = "/clock", "cmd_vel", "~/goal"
EPOCH = 1000.0
"""ROS time [s] at the start: the same in each run, so that a new one is a jump back for who has seen an older one."""
TIME_TO_END = 2.0  # s
WARN_PERIOD = 5.0  # s


def robot_connector(stamped_commands: bool) -> Callable[[NavigationSession], SimulatedRobot]:
    """Return what makes the node of a session's robot; the entry point ``mbf.robot_links``.

    Raises
    ------
    RosError, MissingInterfaceError
        ROS 2, or a package of messages, is missing: before a world is built in vain.
    """
    require_ros_2()
    for kind in (*STATE_TOPICS.values(), INITIAL_POSE_TYPE):
        interface_class(kind)
    return partial(SimulatedRobot, stamped_commands=stamped_commands)


class SimulatedRobot:
    """The node of one robot; ROS 2 is started and ended with it.

    Parameters
    ----------
    session : NavigationSession
        Of the simulation.
    stamped_commands : bool
        Take ``cmd_vel`` as TwistStamped instead of Twist.
    """

    def __init__(self, session: NavigationSession, stamped_commands: bool) -> None:
        self._session = session
        self._context = MessageContext(session.navigator.server.runtime.robot.global_frame, EPOCH)
        self._real_time = WallClock()
        self._newest = NewestCommand(self._real_time)
        self._last: dict[str, Any] = {}
        with ExitStack() as closing:
            closing.enter_context(ros_2())
            self._open(stamped_commands, closing)
            self._closing = closing.pop_all()

    def close(self) -> None:
        """Leave the graph and end ROS 2; once."""
        self._closing.close()

    def publish(self) -> None:
        """Publish the state of the robot, then the time; raises RosError if a callback has failed."""
        self._newest.check()
        for topic, message in self._state.changes():
            self._send(topic, message)
        self._send(CLOCK, {"clock": self._context.time(self._session.clock.now())})

    def repeat(self) -> None:
        """Publish the last message of each topic once more."""
        for topic, message in self._last.items():
            self._publishers[topic].publish(message)

    def show_goal(self, goal: Pose) -> None:
        """Publish a goal, for late subscribers too."""
        self._send(GOAL, pose_stamped(goal, self._context))

    def take(self) -> Command | None:
        """Return the newest command if one has come since the last call."""
        return self._newest.take()

    def wait(self, seconds: float) -> bool:
        """Wait for a command, at most ``seconds`` of real time; returns whether there is one to take.

        Raises RosError if a callback has failed.
        """
        return self._newest.wait(seconds)

    # ---------------------------------------------------------------------------------------------------------
    def _open(self, stamped_commands: bool, closing: ExitStack) -> None:
        import rclpy
        from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data

        self._node: Any = rclpy.create_node(NODE)
        closing.callback(self._node.destroy_node)
        usual, latched = QoSProfile(depth=10), QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        state = state_topics(self._session.sensor_mounts)
        qualities = {topic: qos_profile_sensor_data for topic, kind in state.items() if kind in SENSOR_TOPICS.values()}
        qualities |= {TF: QoSProfile(depth=100), TF_STATIC: latched, GOAL: latched}
        types = {**state, CLOCK: "rosgraph_msgs/Clock", GOAL: "geometry_msgs/PoseStamped"}
        self._classes = {topic: interface_class(kind) for topic, kind in types.items()}
        self._publishers = {
            topic: self._node.create_publisher(kind, _name(topic), qualities.get(topic, usual))
            for topic, kind in self._classes.items()
        }
        command = interface_class(command_type(stamped_commands))
        self._node.create_subscription(command, CMD_VEL, self._taking(stamped_commands), usual)
        inputs = RobotInputs(self._session.clock.now, lambda: self._context)
        Inputs(self._node).listen(inputs.of_localization(self._session.set_initial_pose))
        self._state = RobotMessages(self._session, self._context, self._is_wanted)
        closing.callback(self._state.close)
        spinner = Spinner(self._node, self._real_time, self._newest.fail)
        closing.callback(spinner.close, TIME_TO_END)

    def _is_wanted(self, topic: str) -> bool:
        return bool(self._publishers[topic].get_subscription_count())

    def _send(self, topic: str, message: Message) -> None:
        self._last[topic] = fill(self._classes[topic](), message)
        self._publishers[topic].publish(self._last[topic])

    def _taking(self, stamped: bool) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            values = to_dict(message)
            try:
                command = command_of(values, stamped)
            except InvalidValueError as error:
                self._node.get_logger().warning(f"{CMD_VEL}: {error}", throttle_duration_sec=WARN_PERIOD)
                return
            self._newest.put(command)

        return take


def _name(topic: str) -> str:
    """The name under which a topic is published; those of sensors can be put into a namespace."""
    return topic if topic in (TF, TF_STATIC, CLOCK) else topic.removeprefix("/")


class NewestCommand:
    """One command, or why none will come any more.

    Parameters
    ----------
    real_time : Clock
        On which is waited.
    """

    def __init__(self, real_time: Clock) -> None:
        self._condition = real_time.condition()
        self._command: Command | None = None
        self._failure: BaseException | None = None

    def put(self, command: Command) -> None:
        """Replace the command."""
        with self._condition:
            self._command = command
            self._condition.notify_all()

    def fail(self, error: BaseException) -> None:
        """Let no more commands come, because of a fault of ours; who waits for one goes on at once."""
        with self._condition:
            self._failure = error
            self._condition.notify_all()

    def check(self) -> None:
        """Raise RosError if no more commands will come."""
        if self._failure is not None:
            raise RosError(f"{type(self._failure).__name__}: {error_text(self._failure)}") from self._failure

    def take(self) -> Command | None:
        """Return the command if one has come since the last call."""
        with self._condition:
            command, self._command = self._command, None
            return command

    def wait(self, seconds: float) -> bool:
        """Wait for a command, at most ``seconds`` [s]; returns whether there is one. Raises RosError as ``check``."""
        with self._condition:
            if self._command is None and self._failure is None:
                self._condition.wait(seconds)
            self.check()
            return self._command is not None
