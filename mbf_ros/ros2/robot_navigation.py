"""What all navigators share whose robot is behind topics, a node of ROS 2 as the client of a rosbridge.

They take goals once the robot and its map are there and all kernels are compiled, stop the robot while something fails
to come, and end what was begun before the robot's time jumped.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from contextlib import ExitStack
from typing import Any, ClassVar, Protocol

from mbf_abstract.config.configuration import Config
from mbf_abstract.event_values import error_text
from mbf_abstract.geometry import Command, Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.ticker import Ticker
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.ros2.clock import RosClock
from mbf_ros.ros2.robot import Arrivals, Frames, RosRobot

COMPILING = "compiling kernels"
WATCH_PERIOD = 0.02  # s of real time between two looks at what fails to come: less than a control period


class Commands(Protocol):
    """Where commands go."""

    def publish(self, command: Command) -> None:
        """Publish a command; does not wait."""

    def wait_until_sent(self, seconds: float) -> None:
        """Wait until the last command has left, for at most ``seconds``."""


class RobotNavigation(ABC):
    """The base of such a navigator.

    Parameters
    ----------
    max_silence : float, optional
        Longest time [s] without a message; that of ``command_timeout`` if None.
    time_to_end : float
        Longest time [s] for goals to end and their results to be sent at the end.
    """

    name: ClassVar[str]
    time_name: ClassVar[str]
    """What ends, and which time jumps, in texts for users."""

    session: NavigationSession
    _arrivals: Arrivals
    _frames: Frames
    _clock: RosClock

    def __init__(self, max_silence: float | None, time_to_end: float) -> None:
        self._given_silence, self._time_to_end = max_silence, time_to_end
        self._real_time = WallClock()
        self._ending, self._ready = threading.Event(), threading.Event()
        self._closing = ExitStack()

    def problem(self) -> str:
        """What does not come from the robot, or is not ready here; empty if a goal can be driven."""
        return self._missing() or ("" if self._ready.is_set() else COMPILING)

    def go_to(self, goal: MoveBaseGoal) -> AnyGoalHandle:
        """Send a goal of nobody, as those of topics are; raises ValueError where none is taken yet, or any more."""
        if reason := self._refusal():
            raise ValueError(reason)
        return self.session.navigator.send(goal)

    def close(self) -> None:
        """Stop the robot, end the goals and leave; once."""
        self._closing.close()

    # ------------------------------------------------------------------------------------------- hooks
    @abstractmethod
    def _warn(self, text: str) -> None:
        """Let a text be read."""

    @abstractmethod
    def _begin_to_take_goals(self) -> None:
        """Called once, when goals can be driven."""

    @abstractmethod
    def _forget_arrivals(self) -> None:
        """Count what the robot must send as silent until it comes again."""

    @abstractmethod
    def _abort_goals(self, text: str) -> None:
        """Let the goals of clients end aborted."""

    @abstractmethod
    def _wait_for_results(self) -> bool:
        """Wait ``WATCH_PERIOD`` for results to be sent; returns whether to wait again."""

    # ------------------------------------------------------------------------------------------- parts
    def _make_navigator(self, server_class: Any, config: Config, commands: Commands, time_to_send: float) -> None:
        """Make the session on ``_clock``; at the end it is closed after the last command has left."""
        self.session = NavigationSession(self._clock)
        self._closing.callback(self.session.close)
        self._transforms = TransformBuffer(config.parameters.tf_cache_time)
        self._robot = RosRobot(
            commands.publish, self._transforms, self._clock, self._arrivals, self._frames, self._max_silence
        )
        server = self.session.serve(server_class, config, self._robot, self._transforms)
        self._closing.callback(commands.wait_until_sent, time_to_send)
        self._closing.callback(server.runtime.gate.close, f"the {self.name} is shutting down")

    def _begin(self) -> None:
        """Watch the robot, and get ready for goals."""
        self._clock.on_jump.append(self._on_jump)
        watch = Ticker(self._real_time, self.session.events, self._look, WATCH_PERIOD, "silence watch")
        self._closing.callback(watch.stop)
        self._closing.callback(self._stop_serving)
        self._real_time.spawn(self._get_ready, "warm up")

    def _context(self) -> MessageContext:
        return MessageContext(self._frames.global_frame, self._clock.epoch)

    def _max_silence(self) -> float:
        given = self._given_silence
        return self.session.navigator.server.runtime.parameters.command_timeout if given is None else given

    def _missing(self) -> str:
        """What does not come, of the robot or of maps on topics; empty if all does."""
        try:
            return self._robot.problem() or self.session.navigator.server.missing_floor()
        except Exception as error:  # of a layer that raises at what has come
            return f"{type(error).__name__}: {error_text(error)}"

    def _get_ready(self) -> None:
        """Compile all kernels once the robot and its map are there, then take goals: no goal waits for a compiler."""
        while self._missing():
            if self._ending.wait(WATCH_PERIOD):
                return
        server = self.session.navigator.server
        try:
            start = server.runtime.robot.pose()
            ahead = Pose.planar(1.0, 0.0, frame_id=self._frames.robot_frame)
            server.warm_up(start, Transform.from_pose(start, self._frames.robot_frame).apply_to_pose(ahead))
        except Exception as error:  # of a plugin, or of a robot that fell silent: a goal will say more
            self._warn(f"warming up: {type(error).__name__}: {error_text(error)}")
        self._ready.set()
        self._begin_to_take_goals()

    def _refusal(self) -> str:
        """Why no goals are taken; empty if they are."""
        if self._ending.is_set():
            return f"the {self.name} is shutting down"
        return "" if self._ready.is_set() else f"the {self.name} is not ready: {self.problem()}"

    def _look(self) -> None:
        """Watch the robot; where its time stands still, let time pass for goals that are to end."""
        actions = self.session.navigator.server.actions
        if any(handle.cancel_requested for action in actions for handle in action.unfinished):
            self._clock.stand_in(WATCH_PERIOD, after=self._max_silence())
        self._watch()

    def _watch(self) -> None:
        """Stop the robot where something fails to come."""
        if problem := self._robot.problem():
            self.session.navigator.server.runtime.gate.ask_stop(problem)

    def _on_jump(self, difference: float) -> None:
        """End what was begun before the robot's time jumped, and forget where frames were; static ones stay."""
        text = f"{self.time_name} jumped by {difference:+.3f} s"
        self._warn(text)
        static = [one for one in self._transforms.newest() if one.static]
        self._transforms.clear()
        for one in static:
            self._transforms.set(one)
        self._forget_arrivals()
        self._abort_goals(text)
        self.session.navigator.server.cancel_all(text)

    def _stop_serving(self) -> None:
        """Take no more goals, end those that run, and let their results be sent."""
        self._ending.set()
        server, reason = self.session.navigator.server, f"the {self.name} is shutting down"
        server.runtime.gate.close(reason)
        server.cancel_all(reason)
        deadline = self._real_time.now() + self._time_to_end
        while self._real_time.now() < deadline and self._wait_for_results():
            pass
