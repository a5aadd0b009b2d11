"""One run, live: the server of its messages, requests of clients, and the speed of the run.

As in the live view (``terrain.viewer.live``), threads of the server only post commands; the simulator's thread carries
them out between two steps of the world, and hands on what is new. Nothing waits for the server.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Protocol

from mbf_abstract.access.foxglove import FoxgloveOptions, report_addresses
from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.access.web_socket_server import Offer, WebSocketServer
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_values import error_text
from mbf_abstract.events import Event, EventSink
from mbf_abstract.time.clock import WallClock
from terrain.recording.recording import Recording
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.foxglove.feeds import RunFeed
from terrain.viewer.foxglove.protocol import SUBPROTOCOLS
from terrain.viewer.foxglove.service import FoxgloveService
from terrain.viewer.foxglove.steering import Steering
from terrain.viewer.live.controls import LiveControls
from terrain.viewer.live.orderly_end import orderly_ctrl_c

PART_PERIOD = 0.05  # s of wall time at least between two parts
MOST_FAULTS = 20  # that are noted
SOURCE = "foxglove"
Note = Callable[[str], None]


class ServerNotes(EventSink):
    """A sink for what the server reports; who has been refused is for the user to know."""

    def __init__(self, note: Note) -> None:
        self._note = note

    def write(self, event: Event) -> None:
        """Pass a warning on."""
        if "refused" in event.data:
            self._note(f"{SOURCE}: {event.data['refused']}")


class Faults:
    """Notes what has gone wrong, each text once and not without end."""

    def __init__(self, note: Note) -> None:
        self._note = note
        self._known: set[str] = set()

    def __call__(self, error: Exception) -> None:
        """Note a fault, unless its text is known."""
        text = f"{SOURCE}: {type(error).__name__}: {error_text(error)}"
        if text not in self._known and len(self._known) < MOST_FAULTS:
            self._known.add(text)
            self._note(text)


class Feed(Protocol):
    """Where parts come from."""

    def part(self) -> Recording | None:
        """Return what has come since the last part, None if there is nothing to show yet."""

    def close(self) -> None:
        """Follow no more."""


class LiveServer:
    """A server and the feed of its parts; open from ``start`` until it is closed.

    Parameters
    ----------
    name : str
        Shown by the app.
    note : callable
        Takes what the user should know.
    began : float
        Time [s] of what is there from the start.

    Attributes
    ----------
    port : int
        Where it listens, once it has started.
    """

    def __init__(
        self, name: str, feed: Feed, steering: Steering, options: ServerOptions, note: Note, began: float = 0.0
    ) -> None:
        self.port = 0
        self._feed, self._note, self._options = feed, note, options
        self._wall = WallClock()
        self._next_part = 0.0
        self._faults = Faults(note)
        self._service = FoxgloveService(name, steering, self._post, self._faults, began)
        offer = Offer(SOURCE, extra="foxglove", origin_option="--foxglove-origin", subprotocols=SUBPROTOCOLS)
        self._server = WebSocketServer(self._service, EventBus(self._wall.now, [ServerNotes(note)]), options, offer)

    @property
    def is_watched(self) -> bool:
        """Whether a client is connected."""
        return self._service.is_watched

    def start(self, title: str) -> None:
        """Listen, and say where; raises ServerError where nothing can listen there."""
        self._server.start()
        self.port = self._server.port
        report_addresses(self._options, self.port, self._note, title)

    def close(self) -> None:
        """Listen no more; the feed may still be looked at on another thread, and what that finds is not sent."""
        with ExitStack() as closing:
            closing.callback(self._server.close)
            closing.callback(self._feed.close)

    def look(self) -> None:
        """Hand on the next part, if the last one has been worked on and some time has passed; never waits."""
        if self._service.is_ready and self._wall.now() >= self._next_part:
            self._next_part = self._wall.now() + PART_PERIOD
            self.send_part()

    def send_part(self) -> None:
        """Hand on the next part; on the thread that looks."""
        try:
            part = self._feed.part()
        except Exception as error:  # the robot drives on, and the next part may be fine
            self._faults(error)
            return
        if part is not None:
            self._service.is_ready = False
            self._server.post(self._service.publish, part)

    def _post(self, call: Callable[..., None], *arguments: object) -> None:
        self._server.post(call, *arguments)


class LiveFoxglove:
    """Serves one run; a context manager in which the run takes place.

    Parameters
    ----------
    session : Session
        Made, not running yet.
    speed : float
        Simulated seconds per second at most; 0 = no limit.
    note : callable
        Takes what the user should know: addresses, warnings.
    title : str
        What the addresses are of.

    Attributes
    ----------
    access : PageAccess
        Who has access.

    Raises
    ------
    ServerError
        websockets is not installed, or nothing can listen there; from ``__enter__``.
    """

    def __init__(
        self,
        session: Session,
        sequence: GoalSequence,
        options: FoxgloveOptions,
        speed: float = 1.0,
        note: Note = lambda text: None,
        title: str = "Foxglove",
    ) -> None:
        self._session, self._speed, self._title = session, speed, title
        server_options = options.server_options()
        self.access = server_options.access
        self._controls = controls = LiveControls(session, sequence, SOURCE, "Foxglove")
        steering = Steering(
            session.navigator.server,
            controls.go_to_pose,
            controls.cancel,
            controls.hold,
            session.set_initial_pose,
            controls.post,
        )
        name = f"mbf {session.scenario.name}"
        self._server = LiveServer(name, RunFeed(session), steering, server_options, note)
        self._exits = ExitStack()

    @property
    def port(self) -> int:
        """Where it listens, once the context has been entered."""
        return self._server.port

    def __enter__(self) -> LiveFoxglove:
        with ExitStack() as exits:
            exits.callback(self._server.close)
            self._server.start(self._title)
            exits.callback(self._server.send_part)  # the last one
            end = self._controls.end
            exits.enter_context(orderly_ctrl_c(lambda: self._controls.post(lambda: end("Ctrl-C"))))
            self._exits = exits.pop_all()
        self._session.loop.on_tick.append(self._after_step)
        return self

    def __exit__(self, *exc: object) -> None:
        self._session.loop.on_tick.remove(self._after_step)
        self._exits.close()

    def _after_step(self, time: float) -> None:
        self._controls.work_off()
        self._controls.keep_pace(time, self._speed)
        self._server.look()
