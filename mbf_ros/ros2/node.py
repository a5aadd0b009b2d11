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
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.server.factory import read_config
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import WallClock, unix_seconds
from mbf_abstract.time.ticker import Ticker
from mbf_ros.messages.geometry import NANOSECONDS, MessageContext
from mbf_ros.ros2.actions import ACTIONS, ServedAction, Serving
from mbf_ros.ros2.clock import RosClock, SimulatedRosClock
from mbf_ros.ros2.conversion import interface_class
from mbf_ros.ros2.nav2 import offers_names, serve_actions
from mbf_ros.ros2.nav2_services import Nav2Services
from mbf_ros.ros2.options import NodeOptions
from mbf_ros.ros2.parameters import NodeParameters
from mbf_ros.ros2.robot import Arrivals, Frames, RosRobot
from mbf_ros.ros2.running import RosError, Spinner, ros_2
from mbf_ros.ros2.services import ServedQueries
from mbf_ros.ros2.topics import ODOM, CommandTopic, Inputs, Outputs

NODE = "move_base_flex"
CLOCK = "/clock"
COMPILING = "compiling kernels"
WATCH_PERIOD = 0.05  # s of real time between two looks at what fails to come
CALENDAR_PERIOD = 0.1  # s between two looks at the calendar
CLIENT_PERIOD = 0.5  # s of real time between two looks at who is gone


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


class NavigationNode:
    """The node; made by ``navigation_node``.

    Attributes
    ----------
    failure : str
        Why the node has ended by itself; empty while it runs.
    """

    def __init__(self, options: NodeOptions) -> None:
        import rclpy

        self._options = options
        self.failure = ""
        self._ending, self._failed, self._ready = threading.Event(), threading.Event(), threading.Event()
        self._closing = ExitStack()
        self._real_time = WallClock()
        self._arrivals = Arrivals(self._real_time.now)
        self._node: Any = rclpy.create_node(NODE)
        self._closing.callback(self._node.destroy_node)
        self._spinner = Spinner(self._node, self._real_time, self._fail)
        self._closing.callback(self._spinner.close, options.time_to_end)

    def wait(self, seconds: float) -> bool:
        """Wait until the node fails, at most so long; returns whether it has."""
        return self._failed.wait(seconds)

    def problem(self) -> str:
        """What does not come from the robot, or is not ready here; empty if a goal can be driven."""
        return self._robot.problem() or ("" if self._ready.is_set() else COMPILING)

    def serve(self, server_class: Any, config: Config) -> None:
        """Make the navigator and everything that is seen of it; waits for ``/clock`` with ``use_sim_time``."""
        self._frames = Frames(config.parameters.global_frame, config.parameters.robot_frame)
        self._clock = clock = self._make_clock()
        self._session = session = NavigationSession(clock)
        self._closing.callback(session.close)
        transforms = TransformBuffer(config.parameters.tf_cache_time)
        commands = CommandTopic(
            self._node, self._options.stamped_commands, self._frames.robot_frame, clock, self._context
        )
        robot = RosRobot(commands.publish, transforms, clock, self._arrivals, self._frames, self._max_silence)
        self._robot, self._transforms = robot, transforms
        server = session.serve(server_class, config, robot, transforms)
        self._closing.callback(commands.wait_until_sent, self._options.time_to_send)
        self._closing.callback(server.runtime.gate.close, "the node ends")
        NodeParameters(self._node, server)
        self._open_topics(config)
        serving = Serving(self._send, self._context, self._refusal, self._fail)
        self._actions = [ServedAction(self._node, f"~/{name}", *action, serving) for name, action in ACTIONS.items()]
        self._closing.callback(self._stop_serving)
        if not self._options.keep_goals:
            self._repeat(CLIENT_PERIOD, self._cancel_abandoned)
        queries = ServedQueries(self._node, server, self._context)
        if offers_names(self._node, self._options.nav2, self._real_time):
            self._actions += serve_actions(self._node, server, serving)
            Nav2Services(self._node, server, serving, queries, self._options.stands_for_amcl)
        clock.on_jump.append(self._on_jump)
        watch = Ticker(self._real_time, session.events, self._stop_where_silent, WATCH_PERIOD, "silence watch")
        self._closing.callback(watch.stop)
        self._real_time.spawn(self._get_ready, "warm up")

    def close(self) -> None:
        """Stop the robot, end the goals and leave the graph; once."""
        self._closing.close()

    # ------------------------------------------------------------------------------------------- parts
    def _context(self) -> MessageContext:
        return MessageContext(self._frames.global_frame, self._clock.epoch)

    def _max_silence(self) -> float:
        given = self._options.max_silence
        return self._session.navigator.server.runtime.parameters.command_timeout if given is None else given

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
        navigator = self._session.navigator
        self._outputs = Outputs(self._node, navigator, self._context)
        self._closing.callback(self._outputs.close)
        inputs = Inputs(self._node, self._clock, self._context, self._arrivals)
        inputs.listen_to_robot(self._robot, self._transforms, config.parameters.use_odometry)
        inputs.listen_to_sensors(navigator, self._options.sensors)
        inputs.listen_to_goals(self._send, self._refusal)

    def _get_ready(self) -> None:
        """Compile all kernels once the robot is heard, then take goals: no goal waits for a compiler."""
        while self._robot.problem():
            if self._ending.wait(WATCH_PERIOD):
                return
        server = self._session.navigator.server
        try:
            start = server.runtime.robot.pose()
            ahead = Pose.planar(1.0, 0.0, frame_id=self._frames.robot_frame)
            server.warm_up(start, Transform.from_pose(start, self._frames.robot_frame).apply_to_pose(ahead))
        except Exception as error:  # of a plugin, or of a robot that fell silent: a goal will say more
            self._node.get_logger().warning(f"warming up: {type(error).__name__}: {error_text(error)}")
        self._ready.set()

    def _refusal(self) -> str:
        """Why no goals are taken; empty if they are."""
        if self._ending.is_set():
            return "the node ends"
        return "" if self._ready.is_set() else "the node is not ready"

    def _send(self, goal: Any) -> AnyGoalHandle:
        if isinstance(goal, MoveBaseGoal):
            self._outputs.show_goal(goal)
        return self._session.navigator.send(goal)

    # ------------------------------------------------------------------------------------------- watching
    def _stop_where_silent(self) -> None:
        if problem := self._robot.problem():
            self._session.navigator.server.runtime.gate.ask_stop(problem)

    def _cancel_abandoned(self) -> None:
        for action in self._actions:
            action.cancel_abandoned()

    def _on_jump(self, difference: float) -> None:
        """End what was begun before ROS time jumped, and forget where frames were; static ones stay."""
        text = f"ROS time jumped by {difference:+.3f} s"
        self._node.get_logger().warning(text)
        static = [one for one in self._transforms.newest() if one.static]
        self._transforms.clear()
        for one in static:
            self._transforms.set(one)
        if self._session.navigator.server.config.parameters.use_odometry:
            self._arrivals.expect(ODOM)
        for action in self._actions:
            action.abort_all(text)
        self._session.navigator.server.cancel_all(text)

    def _fail(self, error: BaseException) -> None:
        """Stop the robot for good because of a fault of ours; the node ends."""
        self.failure = f"{type(error).__name__}: {error_text(error)}"
        if hasattr(self, "_session") and hasattr(self._session, "navigator"):
            self._session.events.emit(EventKind.FAULT, NODE, type=type(error).__name__, message=self.failure)
            self._session.navigator.server.runtime.gate.close(f"a callback raised {self.failure}")
        self._failed.set()

    # ------------------------------------------------------------------------------------------- the end
    def _stop_serving(self) -> None:
        """Take no more goals, end those that run, and let their results be sent."""
        self._ending.set()
        self._session.navigator.server.runtime.gate.close("the node ends")
        self._session.navigator.server.cancel_all("the node ends")
        deadline = self._real_time.now() + self._options.time_to_end
        while any(action.unfinished for action in self._actions) and self._real_time.now() < deadline:
            if self._spinner.join(WATCH_PERIOD):
                break
