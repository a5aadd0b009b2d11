"""What a visitor does on a page beside viser's own controls: pointing, dragging, holding a stick, choosing a view.

viser reports clicks and the values of controls only. A script of ours in the page (``visitor.js``) therefore opens a
second WebSocket to the same server, behind the same guard; its address holds a key that only this visitor's script
knows, so nobody speaks for another one. Every message is a JSON object with one entry, see ``parsed``; whatever else
comes is dropped.

A steering script gets a heartbeat: the time of the server's clock, ten times a second. It sends the newest one back
with every position of the stick, so that a report that a slow connection has kept back is known by its age.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from typing import Any

from mbf_abstract.access.outbox import Outbox
from mbf_abstract.access.page_access import Role
from mbf_abstract.time.clock import Clock, WallClock
from terrain.viewer.server.visitor_messages import VisitorActions, parsed

PREFIX = "/visitor/"
BEAT = 0.1  # s between two heartbeats
MAX_REFUSED = 100  # wrong messages after which a visitor is disconnected
POLICY_VIOLATION = 1008  # WebSocket close code (RFC 6455, 7.4.1)


class VisitorChannel:
    """The connections of visitors' scripts.

    Parameters
    ----------
    script : str
        Source of a function of JavaScript that takes the path of the visitor's WebSocket; run in every visitor's page.
    clock : Clock, optional
        Whose time the heartbeat is; a wall clock if not given.

    Attributes
    ----------
    actions : VisitorActions or None
        Gets what visitors do; to be set before visitors come.
    """

    def __init__(self, script: str, clock: Clock | None = None) -> None:
        self.actions: VisitorActions | None = None
        self._script = script
        self._clock = clock or WallClock()
        self._visitors: dict[str, int] = {}  # by key
        self._outboxes: dict[int, _Outbox] = {}

    def attach(self, server: Any) -> None:
        """Have the script run in every page of a viser server."""
        server.on_client_connect(self._welcome)
        server.on_client_disconnect(self._forget)

    def send(self, visitor: int, kind: str, content: object) -> None:
        """Send a visitor the newest content of a kind, from any thread; one that has not been sent yet is replaced."""
        outbox = self._outboxes.get(visitor)
        if outbox is not None:
            outbox.post(kind, json.dumps({kind: content}))

    def broadcast(self, kind: str, content: object) -> None:
        """Send it to every visitor."""
        for visitor in list(self._outboxes):
            self.send(visitor, kind, content)

    async def serve(self, connection: Any, role: Role, path: str) -> None:
        """Hand the messages of one connection to the actions until it ends."""
        visitor, actions = self._visitors.get(path.removeprefix(PREFIX)), self.actions
        if visitor is None or visitor in self._outboxes or actions is None:
            await connection.close(POLICY_VIOLATION, "not a visitor of this page, or connected already")
            return
        outbox = self._outboxes[visitor] = _Outbox(asyncio.get_running_loop())
        self.send(visitor, "role", role.value)
        tasks = [asyncio.create_task(outbox.send_to(connection))]
        if role is Role.STEER:
            tasks.append(asyncio.create_task(self._beat(visitor)))
        try:
            await _take_all(connection, role, visitor, actions)
        finally:
            for task in tasks:
                task.cancel()
            del self._outboxes[visitor]
            actions.leave(visitor)

    async def _beat(self, visitor: int) -> None:
        """Send the heartbeat; one that the connection has not taken yet is replaced by the next."""
        while True:
            self.send(visitor, "beat", self._clock.now())
            await asyncio.sleep(BEAT)

    def _welcome(self, client: Any) -> None:
        from viser._messages import RunJavascriptMessage

        key = secrets.token_urlsafe(16)
        self._visitors[key] = client.client_id
        source = f"({self._script})({json.dumps(PREFIX.removeprefix('/') + key)});"
        client._websock_connection.queue_message(RunJavascriptMessage(source))

    def _forget(self, client: Any) -> None:
        self._visitors = {key: one for key, one in self._visitors.items() if one != client.client_id}


class _Outbox(Outbox):
    """The newest message of each kind that is still to be sent."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._loop = loop
        self._posted: dict[str, str] = {}

    def post(self, kind: str, text: str) -> None:
        """Have a message sent that differs from the last one of its kind; from any thread, never waits."""
        if self._posted.get(kind) != text and not self._loop.is_closed():
            self._posted[kind] = text
            self._loop.call_soon_threadsafe(self.newest, kind, text)


async def _take_all(connection: Any, role: Role, visitor: int, actions: VisitorActions) -> None:
    from websockets.exceptions import ConnectionClosed

    refused = 0
    while refused <= MAX_REFUSED:
        try:
            message = await connection.recv()
        except ConnectionClosed:
            return
        action = parsed(message, role)
        if action is None:
            refused += 1
        else:
            action(actions, visitor)
    await connection.close(POLICY_VIOLATION, "too many messages that are refused here")
