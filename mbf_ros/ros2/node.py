"""The node ``move_base_flex``: a navigator, a robot behind topics, and the actions and services of mbf_msgs.

Everything that comes in is taken by one thread, which never waits: goals are coroutines, questions to the map have
threads of their own. Where a callback raises, or that thread ends for another reason, the robot is stopped first.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from mbf_abstract.config.configuration import Config
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.server.factory import read_config
from mbf_abstract.time.clock import unix_seconds
from mbf_ros.messages.geometry import NANOSECONDS
from mbf_ros.robot_inputs import ODOM, RobotInputs
from mbf_ros.ros2.actions import ACTIONS, ServedAction, Serving
from mbf_ros.ros2.clock import RosClock, SimulatedRosClock
from mbf_ros.ros2.conversion import interface_class
from mbf_ros.ros2.nav2 import offers_names, serve_actions
from mbf_ros.ros2.nav2_services import Nav2Services
from mbf_ros.ros2.neighbours import Mismatches, Namesakes
from mbf_ros.ros2.options import NodeOptions
from mbf_ros.ros2.parameters import NodeParameters
from mbf_ros.ros2.robot import Arrivals, Frames
from mbf_ros.ros2.robot_navigation import WATCH_PERIOD, RobotNavigation
from mbf_ros.ros2.running import RosError, Spinner, ros_2
from mbf_ros.ros2.services import ServedQueries
from mbf_ros.ros2.topics import CommandTopic, Inputs, Outputs
from mbf_ros.sensor_options import used_sensors

NODE = "move_base_flex"
CLOCK = "/clock"
CALENDAR_PERIOD = 0.1  # s between two looks at the calendar
CLIENT_PERIOD = 0.5  # s of real time between two looks at who is gone
NEIGHBOUR_PERIOD = 2.0  # s of real time between two looks at who does not work with us


@contextmanager
def navigation_node(file: Path, options: NodeOptions | None = None) -> Iterator[NavigationNode]:
    """Serve the navigator of a configuration file as a node of ROS 2.

    Raises
    ------
    ConfigError
        The file is wrong.
    RosError, MissingInterfaceError
        ROS 2, or a package of messages, is missing, or Nav2's names are chosen and served by another node.
    """
    options = options or NodeOptions()
    with ExitStack() as closing:
        closing.enter_context(ros_2(options.ros_arguments))
        server_class, config = read_config(file)
        node = NavigationNode(options)
        closing.callback(node.close)
        node.serve(server_class, config)
        yield node


class NavigationNode(RobotNavigation):
    """The node; made by ``navigation_node``.

    Attributes
    ----------
    failure : str
        Why the node has ended by itself; empty while it runs.
    """

    name, time_name = "node", "ROS time"

    def __init__(self, options: NodeOptions) -> None:
        import rclpy

        super().__init__(options.max_silence, options.time_to_end)
        self._options = options
        self.failure = ""
        self._failed = threading.Event()
        self._odom_topic = ODOM
        self._arrivals = Arrivals(self._real_time.now)
        self._node: Any = rclpy.create_node(NODE)
        self._closing.callback(self._node.destroy_node)
        self._spinner = Spinner(self._node, self._real_time, self._fail)
        self._closing.callback(self._spinner.close, options.time_to_end)

    def wait(self, seconds: float) -> bool:
        """Wait until the node fails, at most so long; returns whether it has."""
        return self._failed.wait(seconds)

    def serve(self, server_class: Any, config: Config) -> None:
        """Make the navigator and everything that is seen of it; waits for ``/clock`` with ``use_sim_time``."""
        self._frames = Frames(config.parameters.global_frame, config.parameters.robot_frame)
        self._clock = self._make_clock()
        stamped, robot_frame = self._options.stamped_commands, self._frames.robot_frame
        commands = CommandTopic(self._node, stamped, robot_frame, self._clock, self._context)
        self._make_navigator(server_class, config, commands, self._options.time_to_send)
        server = self.session.navigator.server
        self._odom_topic = NodeParameters(self._node, server).odom_topic
        self._open_topics(config)
        serving = Serving(self.session.navigator.send, self._context, self._refusal, self._fail)
        self._actions = [ServedAction(self._node, f"~/{name}", *action, serving) for name, action in ACTIONS.items()]
        if not self._options.keep_goals:
            self._repeat(CLIENT_PERIOD, self._cancel_abandoned)
        for neighbours in (Namesakes(self._node), Mismatches(self._node)):
            self._repeat(NEIGHBOUR_PERIOD, neighbours.look)
        queries = ServedQueries(self._node, server, self._context)
        if offers_names(self._node, self._options.nav2, self._real_time):
            self._actions += serve_actions(self._node, server, serving)
            Nav2Services(self._node, server, serving, queries, self._options.stands_for_amcl)
        self._begin()

    # ------------------------------------------------------------------------------------------- parts
    def _make_clock(self) -> RosClock:
        if not self._node.get_parameter("use_sim_time").value:
            clock = RosClock(unix_seconds())
            self._repeat(CALENDAR_PERIOD, lambda: clock.follow(unix_seconds()))
            return clock
        return self._simulated_clock()

    def _repeat(self, period: float, call: Callable[[], object]) -> None:
        """Call each ``period`` [s] of real time, on the executor's thread."""
        from rclpy.clock import Clock, ClockType

        self._node.create_timer(period, call, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _simulated_clock(self) -> RosClock:
        from rclpy.qos import qos_profile_sensor_data

        clocks: list[SimulatedRosClock] = []
        came = threading.Event()

        def take(message: Any) -> None:
            ros_time = message.clock.sec + message.clock.nanosec / NANOSECONDS
            if not clocks:
                clocks.append(SimulatedRosClock(ros_time))
            clocks[0].follow(ros_time)
            self._arrivals.hear(CLOCK)
            came.set()

        self._node.create_subscription(interface_class("rosgraph_msgs/Clock"), CLOCK, take, qos_profile_sensor_data)
        while not came.wait(1.0):
            if self.failure:
                raise RosError(self.failure)
            self._node.get_logger().info(f"use_sim_time: waiting for {CLOCK}", throttle_duration_sec=5.0)
        return clocks[0]

    def _open_topics(self, config: Config) -> None:
        navigator = self.session.navigator
        outputs = Outputs(
            self._node, self.session, self._real_time, self._context, self._robot.problems, self._options.map_period
        )
        self._closing.callback(outputs.close)
        inputs = RobotInputs(self._clock.now, self._context, self._arrivals.hear)
        uses_odometry = config.parameters.use_odometry
        self._forget_arrivals()
        sensors = used_sensors(self._options.sensors, navigator.server.listens_to, self._warn)
        listening = Inputs(self._node)
        listening.listen(inputs.of_robot(self._robot, self._transforms, uses_odometry, self._odom_topic))
        listening.listen(inputs.of_sensors(navigator.server.take_scan, sensors))
        listening.listen(inputs.of_maps(navigator.server))
        listening.listen(inputs.of_users(navigator.send, self._refusal))

    # ------------------------------------------------------------------------------------------- watching
    def _warn(self, text: str) -> None:
        self._node.get_logger().warning(text)

    def _begin_to_take_goals(self) -> None:
        """Nothing: goals that come before are refused."""

    def _forget_arrivals(self) -> None:
        if self.session.navigator.server.config.parameters.use_odometry:
            self._arrivals.expect(self._odom_topic)

    def _abort_goals(self, text: str) -> None:
        for action in self._actions:
            action.abort_all(text)

    def _cancel_abandoned(self) -> None:
        for action in self._actions:
            action.cancel_abandoned()

    def _wait_for_results(self) -> bool:
        return any(action.unfinished for action in self._actions) and not self._spinner.join(WATCH_PERIOD)

    def _fail(self, error: BaseException) -> None:
        """Stop the robot for good because of a fault of ours; the node ends."""
        self.failure = f"{type(error).__name__}: {error_text(error)}"
        if hasattr(self, "session") and hasattr(self.session, "navigator"):
            self.session.events.emit(EventKind.FAULT, NODE, type=type(error).__name__, message=self.failure)
            self.session.navigator.server.runtime.gate.close(f"a callback raised {self.failure}")
        self._failed.set()
