"""A navigator whose robot is behind a rosbridge of its own: our side needs no ROS, and runs on any computer.

There are two connections. On one only commands go out, so none waits behind a cloud or a goal; the other has all the
rest. When either is lost the robot is stopped, as far as it can still be reached, and nothing drives it until both are
open and everything that it must send has come again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from mbf_abstract.commands.check import check_config
from mbf_abstract.config.configuration import Config
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.server.factory import read_config
from mbf_ros.robot_inputs import RobotInputs
from mbf_ros.ros2.robot import Frames
from mbf_ros.ros2.robot_navigation import WATCH_PERIOD, RobotNavigation
from mbf_ros.rosbridge_robot.connection import NotConnectedError
from mbf_ros.rosbridge_robot.dialing import check_address
from mbf_ros.rosbridge_robot.goals import OfferedGoals
from mbf_ros.rosbridge_robot.links import LinkArrivals, RobotLinks
from mbf_ros.rosbridge_robot.options import RobotOptions
from mbf_ros.rosbridge_robot.outputs import CommandTopic, Settling, ShownTopics
from mbf_ros.rosbridge_robot.robot_time import RobotTime
from mbf_ros.rosbridge_robot.topics import Reports, RobotTopics
from mbf_ros.sensor_options import used_sensors

REMINDER_PERIOD = 5.0  # s between two reports that the robot's time is not known
NOTED = "robot link"
Report = Callable[[str], None]


@contextmanager
def connect_navigator(
    address: str, file: Path, options: RobotOptions | None = None, report: Report = lambda text: None
) -> Iterator[RobotNavigator]:
    """Navigate a robot by the configuration in a file, until the end of the block.

    Parameters
    ----------
    address : str
        Of the robot's rosbridge, e.g. ``ws://robot:9090``.
    report : callable
        Takes what a user should know while it runs: lost connections, bad messages. What it raises is an event.

    Raises
    ------
    ConfigError
        The file is wrong, or its maps; found before anything is connected.
    LinkError
        The robot cannot be reached, the address is none, or a package is missing.
    """
    check_address(address)
    check_config(file, load=True)
    made = RobotNavigator(address, options or RobotOptions(), report)
    with ExitStack() as closing:
        closing.callback(made.close)
        made.serve(*read_config(file))
        yield made


class RobotNavigator(RobotNavigation):
    """A navigator and its connections; made by ``connect_navigator``."""

    name, time_name = "navigator", "the robot's time"

    def __init__(self, address: str, options: RobotOptions, report: Report) -> None:
        super().__init__(options.max_silence, options.time_to_end)
        self._options, self._take_report = options, report
        self._reports = Reports(self._real_time.now, self._report)
        self._links = RobotLinks(
            address,
            options.link,
            self._real_time,
            self._reports,
            (lambda: self._command_topic.greeting(), self._data_greeting),
            self._on_change,
            lambda fault: self._note(EventKind.FAULT, fault),
        )
        self._arrivals = LinkArrivals(self._real_time.now, lambda: self._links)
        self._topics = RobotTopics(lambda: self._clock.now(), self._context, self._arrivals, self._reports)
        self._links.handlers["publish"] = self._topics.take
        self._time = RobotTime(options.time, self._real_time, self._arrivals)
        self._time.listen(self._topics)
        self._served = threading.Event()
        self._settling = Settling(self._real_time.now)
        self._closing.callback(self._links.close)

    def serve(self, server_class: Any, config: Config) -> None:
        """Connect, and make the navigator; waits for the robot's time where its messages show that."""
        self._frames = Frames(config.parameters.global_frame, config.parameters.robot_frame)
        self._links.open_data()
        self._clock = clock = self._robot_clock()
        stamped, frame_id = self._options.stamped_commands, self._frames.robot_frame
        self._command_topic = CommandTopic(lambda: self._links.commands, stamped, frame_id, clock, self._context)
        self._make_navigator(server_class, config, self._command_topic, self._options.time_to_send)
        self._links.commands.open()
        self._listen(config)
        self._begin()

    # ------------------------------------------------------------------------------------------- parts
    def _robot_clock(self) -> Any:
        """The clock on the robot's time; waits until that is known."""
        while (clock := self._time.clock(REMINDER_PERIOD)) is None:
            self._report(f"waiting for the time of the robot on /{self._time.source.value}")
        return clock

    def _listen(self, config: Config) -> None:
        navigator = self.session.navigator
        self._shown = ShownTopics(
            lambda: self._links.data, self.session, self._real_time, self._context, self._robot.problems
        )
        self._closing.callback(self._shown.close)
        self._goals = OfferedGoals(lambda: self._links.data, navigator.send, self._context)
        inputs = RobotInputs(self._clock.now, self._context, self._topics.hear)
        uses_odometry = config.parameters.use_odometry
        sensors = used_sensors(self._options.sensors, navigator.server.listens_to, self._report)
        self._topics.listen_to(inputs.of_robot(self._robot, self._transforms, uses_odometry))
        self._topics.listen_to(inputs.of_sensors(navigator.server.take_scan, sensors), self._options.cloud_period)
        self._topics.listen_to(inputs.of_maps(navigator.server))
        self._topics.listen_to(inputs.of_users(navigator.send, self._refusal))
        self._links.handlers |= {
            "send_action_goal": self._goals.take_goal,
            "cancel_action_goal": self._goals.take_cancel,
        }
        self._served.set()
        self._links.post([*self._topics.requests(), *self._shown.greeting()])
        self._shown.begin()

    # ------------------------------------------------------------------------------------------- the connections
    def _data_greeting(self) -> list[str]:
        shown = self._shown.greeting() if self._served.is_set() else []
        offers = OfferedGoals.offers() if self._ready.is_set() else ()
        return [*self._topics.requests(), *shown, *offers]

    def _on_change(self, name: str, problem: str) -> None:
        """Stop the robot where a connection is lost, and end the goals that came over it."""
        if problem:
            self._topics.lost()
        if problem and self._served.is_set():
            self.session.navigator.server.runtime.gate.ask_stop(problem)
        if problem and self._served.is_set() and name == self._links.data.name:
            self._goals.abandon(f"the connection to the robot was lost: {problem}")
        if not problem and name == self._links.commands.name:
            self._settling.begin()
        self._note(EventKind.CUSTOM, f"{name}: {problem or 'connected again'}")

    def _report(self, text: str) -> None:
        """Hand a text to the user; what that raises must not end a thread that the robot needs."""
        try:
            self._take_report(text)
        except Exception as error:
            if self._served.is_set():
                fault = f"the report raised {type(error).__name__}: {error_text(error)}"
                self.session.events.emit(EventKind.FAULT, NOTED, message=fault)

    def _note(self, kind: EventKind, text: str) -> None:
        self._report(text)
        if self._served.is_set():
            self.session.events.emit(kind, NOTED, message=text)

    # ------------------------------------------------------------------------------------------- watching
    def _warn(self, text: str) -> None:
        self._note(EventKind.CUSTOM, text)

    def _begin_to_take_goals(self) -> None:
        self._links.post(OfferedGoals.offers())

    def _forget_arrivals(self) -> None:
        self._topics.lost()

    def _abort_goals(self, text: str) -> None:
        self._goals.abort_all(text)

    def _watch(self) -> None:
        self._time.follow_calendar()
        if self._links.commands.problem:  # zero cannot be sent; the gate tries again every command_timeout
            return
        super()._watch()
        if self._settling.is_due(is_heard=not self._robot.problem()):
            with suppress(NotConnectedError):
                self._command_topic.repeat_zero()

    # ------------------------------------------------------------------------------------------- the end
    def _wait_for_results(self) -> bool:
        if not self._goals.unfinished or self._links.data.problem:
            return False
        self._real_time.sleep(WATCH_PERIOD)
        return True

    def _stop_serving(self) -> None:
        super()._stop_serving()
        self._links.data.wait_until_sent(self._options.time_to_send)
