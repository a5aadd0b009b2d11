"""Access control between the network and viser: refuses visitors without access, and messages that are not allowed.

viser has no hook for that, so its server is started with a request handler and a connection handler of ours around its
own. Whether that has worked is checked, see ``PageGuard.is_installed``.
"""

from __future__ import annotations

import http
import logging
import threading
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

from mbf_abstract.access.admission import PRIVATE_HEADERS
from mbf_abstract.access.page_access import PageAccess
from terrain.viewer.server.page_messages import is_allowed
from terrain.viewer.server.visitor_channel import MAX_REFUSED, POLICY_VIOLATION, PREFIX, VisitorChannel

MAX_MESSAGE = 64 * 1024  # bytes; messages of a browser are far shorter
MAX_VISITORS = 32
TRY_AGAIN_LATER = 1013  # WebSocket close code (RFC 6455, 7.4.1)

_logger = logging.getLogger(__name__)
_logger.addHandler(logging.NullHandler())  # wrong requests must not fill the terminal
_starting = threading.Lock()  # one server is started at a time, see ``installed``


class PageGuard:
    """Guards one page.

    Parameters
    ----------
    channel : VisitorChannel, optional
        Takes the connections of visitors' own scripts.

    Attributes
    ----------
    is_installed : bool
        Whether a server was started behind this guard.
    controls : mapping of str to viser.GuiInputHandle
        The page's controls by their identifiers; to be set once the page exists.
    """

    def __init__(self, access: PageAccess, channel: VisitorChannel | None = None) -> None:
        self.is_installed = False
        self.controls: Mapping[str, Any] = {}
        self._access = access
        self._channel = channel
        self._visitors = 0

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Have servers of websockets that are started inside begin behind this guard."""
        import websockets.asyncio.server as library

        with _starting:
            serve = library.serve
            library.serve = partial(self._serve, serve)  # type: ignore[misc, assignment]
            try:
                yield
            finally:
                library.serve = serve  # type: ignore[misc]

    def refusal(self, path: str, headers: Any) -> tuple[http.HTTPStatus, str] | None:
        """Return why a request is refused, None if it is not.

        Parameters
        ----------
        path : str
            With its token and query.
        """
        hosts, origins, upgrades = (headers.get_all(name) for name in ("Host", "Origin", "Upgrade"))
        if len(hosts) != 1 or not self._access.knows_host(hosts[0]):
            return http.HTTPStatus.FORBIDDEN, "this is not the name of the machine that serves the page"
        if len(origins) > 1 or len(upgrades) > 1 or upgrades not in ([], ["websocket"]):
            return http.HTTPStatus.BAD_REQUEST, "not a request of a browser"
        if (origins or upgrades) and not (origins and self._access.is_same_site(origins[0], hosts[0])):
            return http.HTTPStatus.FORBIDDEN, "only the page itself may ask for that"
        if self._access.role_and_path(path) is None:
            return http.HTTPStatus.FORBIDDEN, "the address needs the token that was printed when the page was served"
        return None

    def _serve(
        self, serve: Callable[..., Any], handler: Callable[[Any], Awaitable[None]], *args: Any, **kw: Any
    ) -> Any:
        """Start a server as asked for, with both handlers behind this guard."""
        process = kw.get("process_request") or (lambda connection, request: None)
        guarded = {
            "process_request": partial(self._process_request, process),
            "max_size": MAX_MESSAGE,
            "logger": _logger,
        }
        self.is_installed = True
        return serve(partial(self._handle, handler), *args, **{**kw, **guarded})

    def _process_request(self, process: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
        refused = self.refusal(request.path, request.headers)
        if refused is not None:
            status, reason = refused
            return connection.respond(status, f"{reason}\n")
        found = self._access.role_and_path(request.path)
        assert found is not None
        response = process(connection, replace(request, path=found[1]))
        if response is not None:
            response.headers.update(PRIVATE_HEADERS)
        return response

    async def _handle(self, handler: Callable[[Any], Awaitable[None]], connection: Any) -> None:
        found = self._access.role_and_path(connection.request.path)
        if found is not None and self._channel is not None and found[1].startswith(PREFIX):
            await self._channel.serve(connection, *found)
            return
        if found is None or self._visitors >= MAX_VISITORS:
            await connection.close(TRY_AGAIN_LATER, "too many visitors")
            return
        self._visitors += 1
        try:
            await handler(_CheckedConnection(connection, lambda message: is_allowed(message, found[0], self.controls)))
        finally:
            self._visitors -= 1


class _CheckedConnection:
    """A connection whose wrong messages are dropped."""

    def __init__(self, connection: Any, accepts: Callable[[bytes | str], bool]) -> None:
        self._connection = connection
        self._accepts = accepts
        self._refused = 0

    async def recv(self) -> bytes | str:
        """Wait for the next message that may go on."""
        while True:
            message: bytes | str = await self._connection.recv()
            if self._accepts(message):
                return message
            self._refused += 1
            if self._refused > MAX_REFUSED:
                await self._connection.close(POLICY_VIOLATION, "too many messages that are refused here")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)
