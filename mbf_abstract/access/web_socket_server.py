"""A WebSocket server: it lets clients in, see ``admission``, and carries their frames in and out.

It runs on a thread and an event loop of its own. Other threads hand it work with ``post`` and never wait for it.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Generic

from mbf_abstract.access.admission import Admission
from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.access.visitor import AnyVisitor, Service, Visitor
from mbf_abstract.event_bus import EventBus
from mbf_abstract.events import EventKind
from mbf_abstract.time.clock import ClockThread, WallClock

POLICY_VIOLATION, TRY_AGAIN_LATER = 1008, 1013  # WebSocket close codes (RFC 6455, 7.4.1)
TIME_TO_AUTHENTICATE = 10.0  # s
TIME_TO_START, TIME_TO_SEND, TIME_TO_STOP = 10.0, 0.5, 3.0  # s
TIME_TO_SAY_GOODBYE = 1.0  # s for a client to answer that the connection closes
WRITE_LIMIT = 32 * 1024  # bytes on their way to one client, after which frames wait in its outbox

_logger = logging.getLogger(__name__)
_logger.addHandler(logging.NullHandler())  # wrong requests must not fill the terminal


class ServerError(Exception):
    """The server cannot listen; the text says why."""


@dataclass(frozen=True)
class Offer:
    """What a server offers beside its service.

    Attributes
    ----------
    name : str
        Of the source of its events.
    extra : str
        Extra of this package that brings websockets.
    origin_option : str
        Option of the command line that lets the pages of an origin in.
    subprotocols : tuple of str
        Those that it speaks, the best first; a client must speak one of them. Without any, none is negotiated.
    pages : mapping of str to (str, bytes)
        Content type and content of each path that is answered over HTTP.
    takes_auth : bool
        Whether a client may connect without the token and give it by an operation.
    """

    name: str
    extra: str
    origin_option: str
    subprotocols: tuple[str, ...] = ()
    pages: Mapping[str, tuple[str, bytes]] = field(default_factory=dict)
    takes_auth: bool = False


class WebSocketServer(Generic[AnyVisitor]):
    """Serves from ``start`` until it is closed.

    Parameters
    ----------
    events : EventBus
        Learns who comes and goes, and who is refused.

    Attributes
    ----------
    port : int
        Where it listens, once it has started.

    Raises
    ------
    ServerError
        The package websockets is missing.
    """

    def __init__(self, service: Service[AnyVisitor], events: EventBus, options: ServerOptions, offer: Offer) -> None:
        try:
            import websockets.asyncio.server  # noqa: F401
        except ImportError as error:
            text = f"{offer.name} needs websockets: pip install 'mbf-flex[{offer.extra}]' ({error})"
            raise ServerError(text) from error
        self.port = 0
        self._service, self._events, self._options, self._offer = service, events, options, offer
        self._loop = asyncio.new_event_loop()
        self._end: asyncio.Event | None = None
        self._visitors: set[AnyVisitor] = set()
        self._admission = Admission(
            options.access, options.origins, offer.pages, offer.origin_option, offer.takes_auth, self._report_refusal
        )
        self._started = threading.Event()
        self._problem: BaseException | None = None
        self._thread: ClockThread | None = None

    def start(self) -> None:
        """Listen; raises ServerError where nothing can listen there."""
        self._thread = WallClock().spawn(self._run, self._offer.name)
        self._started.wait(TIME_TO_START)
        if self._problem is not None:
            host, port = self._options.access.host, self._options.port
            reason = str(self._problem).rpartition("): ")[2]  # without the address, which asyncio repeats
            raise ServerError(f"cannot listen at {host}:{port}: {reason}") from self._problem

    def post(self, call: Callable[..., None], *arguments: Any) -> None:
        """Have a function called on the event loop; never waits, and does nothing once the server is closed."""
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(call, *arguments)

    def close(self) -> None:
        """Disconnect all clients and listen no more; idempotent."""
        if self._end is not None:
            self.post(self._end.set)
        if self._thread is not None:
            self._thread.join(TIME_TO_STOP)

    # ---------------------------------------------------------------------------------------- on the event loop
    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        except BaseException as error:
            self._problem = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        self._end = asyncio.Event()
        async with await self._listen() as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            self._started.set()
            await self._end.wait()
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._until_sent(), TIME_TO_SEND)
        for task in asyncio.all_tasks() - {asyncio.current_task()}:
            task.cancel()

    async def _listen(self) -> Any:
        """Listen at the first port that is free; raises OSError where none is."""
        from websockets.asyncio.server import serve
        from websockets.typing import Subprotocol

        for port in range(self._options.port, last := self._options.port + self._options.ports):
            try:
                return await serve(
                    self._handle,
                    self._options.access.host,
                    port,
                    process_request=self._admission.answer,
                    subprotocols=[Subprotocol(name) for name in self._offer.subprotocols] or None,
                    max_size=self._options.max_message,
                    write_limit=WRITE_LIMIT,
                    close_timeout=TIME_TO_SAY_GOODBYE,
                    compression=None,
                    logger=_logger,
                )
            except OSError:
                if port + 1 == last:
                    raise

    async def _until_sent(self) -> None:
        """Wait until nothing waits in the outboxes, so that the last command reaches its robot."""
        while not all(client.outbox.is_empty for client in self._visitors):
            await asyncio.sleep(0.01)

    def _report_refusal(self, text: str) -> None:
        self._events.emit(EventKind.CUSTOM, self._offer.name, refused=text)

    async def _handle(self, connection: Any) -> None:
        """Serve one client until it is gone."""
        from websockets.exceptions import ConnectionClosed

        is_known = self._options.access.role_and_path(connection.request.path) is not None
        alike = sum((visitor.role is not None) == is_known for visitor in self._visitors)
        if alike >= self._options.max_clients:  # who gives no token takes the place of none who has one
            await connection.close(TRY_AGAIN_LATER, "too many clients")
            return
        client = self._welcome(connection)
        sending = asyncio.create_task(client.outbox.send_to(connection))
        authenticating = asyncio.create_task(self._await_token(client))
        try:
            async for frame in connection:
                self._service.take(client, frame)
                if client.outbox.overflowed:
                    client.hang_up("too many unread answers")
                    break
                await asyncio.sleep(0)  # a client that sends without a pause leaves the others their turns
        except ConnectionClosed:
            pass
        finally:
            sending.cancel()
            authenticating.cancel()
            self._visitors.discard(client)
            self._service.forget(client)
            self._events.emit(EventKind.CUSTOM, self._offer.name, message="client gone", client=client.name)

    def _welcome(self, connection: Any) -> AnyVisitor:
        found = self._options.access.role_and_path(connection.request.path)
        address = connection.remote_address or ("?", 0)

        def hang_up(reason: str) -> None:
            closing = connection.close(POLICY_VIOLATION, reason)
            self._loop.call_soon(lambda: asyncio.ensure_future(closing))

        client = self._service.welcome(f"{address[0]}:{address[1]}", found[0] if found else None, hang_up)
        self._visitors.add(client)
        self._events.emit(EventKind.CUSTOM, self._offer.name, message="client connected", client=client.name)
        return client

    @staticmethod
    async def _await_token(client: Visitor) -> None:
        if client.role is None:
            await asyncio.sleep(TIME_TO_AUTHENTICATE)
            if client.role is None:
                client.hang_up("no token")
