"""The robot of a navigator live in Foxglove, for packages that connect robots: the entry point ``mbf.live_apps``."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from mbf_abstract.access.foxglove import FoxgloveOptions
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.ticker import Ticker
from terrain.session.session import Session
from terrain.viewer.foxglove.feeds import RunFeed
from terrain.viewer.foxglove.live import SOURCE, LiveServer
from terrain.viewer.foxglove.protocol import ProtocolError
from terrain.viewer.foxglove.robot_feed import RobotFeed
from terrain.viewer.foxglove.steering import Steering

PERIOD = 0.1  # s between two looks at a robot


@contextmanager
def serve_robot(
    session: NavigationSession,
    send: Callable[[MoveBaseGoal], Any],
    options: FoxgloveOptions,
    name: str,
    note: Callable[[str], None],
) -> Iterator[LiveServer]:
    """Serve a session whose navigator is there, on a wall clock, until the end of the block.

    Parameters
    ----------
    session : NavigationSession
        Of a scenario, it is shown as ``mbf run`` shows it.
    send : callable
        Takes goals; raises ValueError where none are taken.
    name : str
        Of the robot.
    note : callable
        Takes what the user should know: addresses, warnings.

    Raises
    ------
    ServerError
        websockets is not installed, or nothing can listen there.
    """
    robot = SteeredRobot(session, send)
    steering = Steering(session.navigator.server, robot.go_to, robot.cancel, robot.hold, robot.set_initial_pose)
    feed = RunFeed(session) if isinstance(session, Session) else RobotFeed(session, name)
    began = 0.0 if isinstance(feed, RunFeed) else feed.began
    server = LiveServer(f"mbf {name}", feed, steering, options.server_options(), note, began)

    if isinstance(feed, RobotFeed):
        feed.is_watched = lambda: server.is_watched

    def look(*_: float) -> None:
        robot.keep_holding()
        server.look()

    with ExitStack() as closing:
        closing.callback(server.close)
        server.start("Foxglove")
        if isinstance(session, Session):  # its recorder belongs to the simulator's thread
            session.loop.on_tick.append(look)
            closing.callback(session.loop.on_tick.remove, look)
        else:
            closing.callback(Ticker(WallClock(), session.events, look, PERIOD, SOURCE).stop)
        yield server


class SteeredRobot:
    """Goals of clients for a navigator."""

    def __init__(self, session: NavigationSession, send: Callable[[MoveBaseGoal], Any]) -> None:
        self._session, self._server, self._send = session, session.navigator.server, send
        self._holding, self._lock = False, threading.Lock()  # two threads pause goals

    def go_to(self, goal: Pose) -> None:
        """Send a goal, which a newer one takes over; raises ProtocolError where it is not taken."""
        try:
            handle = self._send(MoveBaseGoal(goal))
        except ValueError as error:
            raise ProtocolError(str(error)) from error
        if handle.done and handle.result is not None:
            raise ProtocolError(handle.result.message)

    def set_initial_pose(self, pose: Pose) -> None:
        """Say where the robot is; raises ProtocolError where that is of no use."""
        try:
            self._session.set_initial_pose(pose)
        except ValueError as error:
            raise ProtocolError(str(error)) from error

    def cancel(self) -> None:
        """End all goals."""
        self._server.cancel_all("canceled in Foxglove")

    def hold(self, holding: bool) -> None:
        """Pause all goals, those to come as well, or let them go on."""
        with self._lock:
            self._holding = holding
            if holding:
                self._server.pause_all()
            else:
                self._server.resume_all()

    def keep_holding(self) -> None:
        """Pause goals that have come since the last look."""
        with self._lock:
            if self._holding:
                self._server.pause_all()
