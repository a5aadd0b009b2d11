"""A clock, a record of the events, a robot, its server and a navigator, wired together and closed in the right order.

When to use: simulations, tests and commands that make their own robot. When not: on a real robot, for which
``Navigator.from_file`` is enough.

Example
-------
>>> with NavigationSession() as session:
...     session.serve(*read_config("navigation.yaml"), robot)
...     session.navigator.go_to(Pose.planar(8.0, 3.0))
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from mbf_abstract.config.configuration import Config
from mbf_abstract.drive.robot import Robot
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind, EventSink
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock
from mbf_abstract.time.sim_clock import SimClock

Session = TypeVar("Session", bound="NavigationSession")
Server = TypeVar("Server", bound=AbstractNavigationServer)

TIME_TO_END = 1.0  # s of simulated time for threads to end; it passes only while a thread waits


class NavigationSession:
    """What navigation of one robot needs, on one clock; a context manager, or call ``close``.

    Parameters
    ----------
    clock : Clock, optional
        A new ``SimClock`` if not given.
    sinks : iterable of EventSink
        Where events go, beside the session's memory.
    max_events : int
        How many events the memory keeps.

    Attributes
    ----------
    events : EventBus
    memory : MemorySink
        The events so far.
    navigator : Navigator
        Of the server, once there is one.
    sensor_mounts : dict of str to Transform
        Where the range sensors of a simulated robot sit on it, static, by their names.
    on_initial_pose : list of callables
        Take an initial pose: what localises the robot, or leads there. Called on any thread; must not wait.
    """

    navigator: Navigator

    def __init__(self, clock: Clock | None = None, sinks: Iterable[EventSink] = (), max_events: int = 100_000) -> None:
        self.clock: Clock = clock or SimClock()
        self.memory = MemorySink(max_events)
        self.events = EventBus(self.clock.now, [self.memory, *sinks])
        self.sensor_mounts: dict[str, Transform] = {}
        self.on_initial_pose: list[Callable[[Pose], None]] = []
        self._calls_at_close: list[Callable[[], object]] = []
        self.on_close(self.events.close)
        self.on_close(self._let_threads_end)

    def serve(
        self,
        server_class: type[Server],
        config: Config,
        robot: Robot,
        transforms: TransformBuffer | None = None,
        seed: int = 0,
    ) -> Server:
        """Make the server of a configuration; the parameters, and what is raised, are those of its class.

        Where it raises, the session is closed.
        """
        try:
            server = server_class(config, robot, self.clock, transforms, self.events, seed)
        except BaseException:
            self.close()
            raise
        self.on_close(server.close)
        self.navigator = Navigator(server)
        return server

    def set_initial_pose(self, pose: Pose) -> None:
        """Hand a pose of the robot, in the global frame, to what localises it, as ``/initialpose`` does.

        Raises
        ------
        ValueError
            The pose is in another frame, or nothing here leads to a localisation.
        """
        known = self.navigator.server.config.parameters.global_frame
        if pose.frame_id != known:
            raise ValueError(f"expected an initial pose in the frame {known!r}, got {pose.frame_id!r}")
        if not self.on_initial_pose:
            raise ValueError("an initial pose is of no use: nothing here localises the robot")
        x, y, yaw = (round(value, 3) for value in (pose.x, pose.y, pose.yaw))
        self.events.emit(EventKind.CUSTOM, "localization", what="initial pose", x=x, y=y, yaw=yaw)
        for listener in self.on_initial_pose:
            listener(pose)

    def on_close(self, call: Callable[[], object]) -> None:
        """Let the session end with this call; what was made last ends first."""
        self._calls_at_close.append(call)

    def close(self) -> None:
        """Stop the robot, close the server and let the threads end; once.

        Whatever a call raises, those after it are made; the last error has the ones before as its context. An
        ``ExitStack`` loses that: a Ctrl-C was an error about the lock that it had left.
        """
        if self._calls_at_close:
            try:
                self._calls_at_close.pop()()
            finally:
                self.close()

    def _let_threads_end(self) -> None:
        if isinstance(self.clock, SimClock):
            self.clock.sleep(TIME_TO_END)

    def __enter__(self: Session) -> Session:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()
