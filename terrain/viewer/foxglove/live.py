"""One run, live: the server of its messages, requests of clients, and the speed of the run.

As in the live view (``terrain.viewer.live``), threads of the server only post commands; the simulator's thread carries
them out between two steps of the world, and hands on what is new. Nothing waits for the server.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack

from mbf_abstract.access.web_socket_server import Offer, ServerOptions, WebSocketServer
from mbf_abstract.events import Event, EventBus
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.pace import Pace
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.foxglove.channels import FoxgloveClient
from terrain.viewer.foxglove.feeds import RunFeed
from terrain.viewer.foxglove.options import FoxgloveOptions, report_addresses
from terrain.viewer.foxglove.protocol import SUBPROTOCOLS
from terrain.viewer.foxglove.service import FoxgloveService
from terrain.viewer.foxglove.steering import Steering
from terrain.viewer.live.controls import LiveControls
from terrain.viewer.live.orderly_end import orderly_ctrl_c

PART_PERIOD = 0.05  # s of wall time at least between two parts
SOURCE = "foxglove"
FoxgloveServer = WebSocketServer[FoxgloveClient]
Note = Callable[[str], None]


class ServerNotes:
    """A sink for what the server reports; who has been refused is for the user to know."""

    def __init__(self, note: Note) -> None:
        self._note = note

    def write(self, event: Event) -> None:
        """Pass a warning on."""
        if "refused" in event.data:
            self._note(f"{SOURCE}: {event.data['refused']}")

    def close(self) -> None:
        """Do nothing."""


def foxglove_server(service: FoxgloveService, options: ServerOptions, note: Note) -> FoxgloveServer:
    """Return a server, not started yet; what it reports is a note, and no event of the run."""
    wall = WallClock()
    offer = Offer(SOURCE, extra="foxglove", origin_option="--foxglove-origin", subprotocols=SUBPROTOCOLS)
    return WebSocketServer(service, EventBus(wall.now, [ServerNotes(note)]), options, offer)


class LiveFoxglove:
    """Serves one run; a context manager in which the run takes place.

    Parameters
    ----------
    session : Session
        Made, not running yet.
    sequence : GoalSequence
    options : FoxgloveOptions
    speed : float
        Simulated seconds per second at most; 0 = no limit.
    note : callable
        Takes what the user should know: addresses, warnings.
    title : str
        What the addresses are of.

    Attributes
    ----------
    port : int
        Where it listens, once the context has been entered.
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
        self.port = 0
        self._session, self._sequence, self._speed = session, sequence, speed
        self._note, self._title = note, title
        self._options = options.server_options()
        self.access = self._options.access
        self._controls = controls = LiveControls(session, sequence, SOURCE, "Foxglove")
        steering = Steering(
            session.navigator.server, controls.go_to_pose, controls.cancel, controls.hold, controls.post
        )
        self._service = FoxgloveService(f"mbf {session.scenario.name}", steering, self._post, note)
        self._server = foxglove_server(self._service, self._options, note)
        self._wall = WallClock()
        self._pace = Pace(self._wall)
        self._next_part = 0.0
        self._exits = ExitStack()

    def __enter__(self) -> LiveFoxglove:
        with ExitStack() as exits:
            self._server.start()
            exits.callback(self._server.close)
            self.port = self._server.port
            self._feed = RunFeed(self._session)
            exits.callback(self._feed.close)
            end = self._controls.end
            exits.enter_context(orderly_ctrl_c(lambda: self._controls.post(lambda: end("Ctrl-C"))))
            self._exits = exits.pop_all()
        self._session.loop.on_tick.append(self._after_step)
        report_addresses(self._options, self.port, self._note, self._title)
        return self

    def __exit__(self, *exc: object) -> None:
        self._session.loop.on_tick.remove(self._after_step)
        self._send_part()
        self._exits.close()

    def _post(self, call: Callable[..., None], *arguments: object) -> None:
        self._server.post(call, *arguments)

    def _after_step(self, time: float) -> None:
        self._controls.work_off()
        self._pace.wait(time, self._limit())
        if self._service.is_ready and self._wall.now() >= self._next_part:
            self._next_part = self._wall.now() + PART_PERIOD
            self._send_part()

    def _send_part(self) -> None:
        self._service.is_ready = False
        self._server.post(self._service.publish, self._feed.part())

    def _limit(self) -> float:
        """Simulated seconds per second; in real time while the run waits for a goal. A wall clock needs no pacing."""
        if isinstance(self._session.clock, WallClock):
            return 0.0
        return self._speed or (1.0 if self._sequence.is_waiting else 0.0)
