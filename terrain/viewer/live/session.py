"""Watches and steers one run: serves the page, handles its requests, and limits the speed of the run.

All of it happens on the simulator's thread after a step of the world (``DriveLoop.on_tick``). Nothing is drawn
without visitors. If the page fails, the run continues without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from mbf_abstract.access.page_access import LOOPBACK, PageAccess, Role, is_loopback
from mbf_abstract.events import EventKind
from mbf_abstract.geometry.tilt import tilt_of
from mbf_abstract.time.clock import WallClock
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.live.controls import LiveControls
from terrain.viewer.live.log import LiveLog
from terrain.viewer.live.orderly_end import orderly_ctrl_c
from terrain.viewer.live.page import LivePage
from terrain.viewer.live.plots import PERIOD, UNWATCHED_PERIOD, History
from terrain.viewer.live.stick import Stick
from terrain.viewer.server.page_server import page_server
from terrain.viewer.server.visitor_channel import VisitorChannel

SCRIPT = Path(__file__).with_name("visitor.js")
FRAME_PERIOD = 0.1  # s of wall time between two drawings


@dataclass(frozen=True)
class ViewOptions:
    """Where the page is served and how time passes.

    Attributes
    ----------
    host : str
        Interface to listen at.
    port : int
        The first one tried; the next free one is taken.
    speed : float
        Simulated seconds per second at most; 0 = as fast as possible.
    token : bool
        Put a token into the address, so that only those who know it have access.
    read_only : bool
        Watching only; else there are two addresses, one to steer and one to watch.

    Raises
    ------
    ValueError
        A negative speed, or no token on an interface that other machines can reach.
    """

    host: str = LOOPBACK
    port: int = 8080
    speed: float = 1.0
    token: bool = True
    read_only: bool = False

    def __post_init__(self) -> None:
        if self.speed < 0.0:
            raise ValueError(f"speed must not be negative, got {self.speed}")
        if not self.token and not is_loopback(self.host):
            raise ValueError(f"without a token a page is served at loopback only, not at {self.host!r}")

    def access(self) -> PageAccess:
        """Return the access control of the page, with new tokens each time."""
        make = PageAccess.by_token if self.token else PageAccess.open
        return make(self.host, self.read_only)


class LiveSession:
    """Serves the page of one run; a context manager in which the run takes place.

    Parameters
    ----------
    session : Session
        Made, not running yet.
    on_page : callable
        Called with the page's address.
    on_note : callable
        Called with warnings about access to the page.

    Attributes
    ----------
    address, watching_address : str
        Addresses of the page to steer and to watch, once the context has been entered; empty where there is none.
    controls : LiveControls
        What the page may ask for.

    Raises
    ------
    ViewerMissing
        viser is not installed, or cannot listen at the address; from ``__enter__``.
    """

    def __init__(
        self,
        session: Session,
        sequence: GoalSequence,
        options: ViewOptions,
        on_page: Callable[[str], None] = lambda address: None,
        on_note: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.address = self.watching_address = ""
        self.controls = LiveControls(session, sequence)
        self._session = session
        self._sequence = sequence
        self._options = options
        self._on_page = on_page
        self._on_note = on_note
        self._log = LiveLog()
        self._history = History()
        self._wall = WallClock()
        self._next_frame = 0.0
        self._stick = Stick(
            session.navigator.server, self._wall, self.controls.take_over, self.controls.note_end_of_teleoperation
        )
        self._page: LivePage | None = None
        self._exits = ExitStack()

    def __enter__(self) -> LiveSession:
        session, access = self._session, self._options.access()
        with ExitStack() as exits:
            channel = VisitorChannel(SCRIPT.read_text("utf-8"), self._wall)
            title = "mbf " + session.scenario.name
            server = exits.enter_context(page_server(self._options.port, access, title, channel))
            steered = Role.STEER in access.roles.values()
            self._page = page = LivePage(
                server, session, self._sequence, self.controls, self._log, self._stick, channel, steered
            )
            exits.enter_context(orderly_ctrl_c(lambda: self.controls.post(lambda: self.controls.end("Ctrl-C"))))
            self.address = access.address(server.get_port(), Role.STEER) or ""
            self.watching_address = access.address(server.get_port(), Role.WATCH) or ""
            self._exits = exits.pop_all()
        self._sequence.on_goal.append(page.things.show_goal)
        session.events.add_sink(self._log)
        session.loop.on_tick.append(self._after_step)
        self._report_addresses()
        return self

    def _report_addresses(self) -> None:
        self._on_page(self.address or self.watching_address)
        if self.address and self.watching_address:
            self._on_note(f"for those who may only watch: {self.watching_address}")
        if not is_loopback(self._options.host):
            self._on_note(
                f"warning: other machines can reach the page at {self._options.host}, and it is not encrypted; who has "
                "or overhears the address can drive the robot"
            )

    def __exit__(self, *exc: object) -> None:
        self._session.loop.on_tick.remove(self._after_step)
        self._stick.stop("the run has ended")
        self._session.events.remove_sink(self._log)
        self._exits.close()

    def _after_step(self, time: float) -> None:
        self.controls.work_off()
        if self._page is not None:
            self._stick.step(self.controls.holding)
        self.controls.keep_pace(time, self._options.speed)
        if self._page is None:
            return
        try:
            self._sample(time, PERIOD if self._page.is_watched else UNWATCHED_PERIOD)
            self._show(self._page, time)
        except Exception as error:  # whatever the page's library may raise, the run does not depend on it
            self._page = None
            self._stick.stop("the page has failed")
            self._session.events.emit(EventKind.FAULT, "live_view", type=type(error).__name__, message=str(error))

    def _sample(self, time: float, period: float) -> None:
        if self._history.is_due(time, period):
            robot, queries = self._session.simulation.robot, self._session.navigator.server.queries
            pose = robot.pose()
            self._history.add(time, robot.velocity().speed, math.degrees(tilt_of(pose)), queries.check_point(pose).cost)

    def _show(self, page: LivePage, time: float) -> None:
        if page.is_watched and self._wall.now() >= self._next_frame:
            page.show(time, self._history)
            self._next_frame = self._wall.now() + FRAME_PERIOD
