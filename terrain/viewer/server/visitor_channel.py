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
from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

from mbf_abstract.access.page_access import Role
from mbf_abstract.time.clock import Clock, WallClock

PREFIX = "/visitor/"
LONGEST = 200  # characters of a message
LARGEST = 1e12  # of a number; nan and infinity are none
BEAT = 0.1  # s between two heartbeats
MAX_REFUSED = 100  # wrong messages after which a visitor is disconnected
POLICY_VIOLATION = 1008  # WebSocket close code (RFC 6455, 7.4.1)
STEERING = ("goal", "stick")
VIEWS = ("free", "follow", "overview", "storey")
Place: TypeAlias = tuple[float, float]
"""A place in the picture of the scene: (0, 0) is its upper left corner, (1, 1) its lower right one."""


class VisitorActions(Protocol):
    """What visitors may do; called on the server's event loop, must not wait or raise."""

    def point(self, visitor: int, place: Place | None) -> None:
        """Note where the pointer of a visitor is; None when it has left the scene."""

    def place_goal(self, visitor: int, start: Place, end: Place) -> None:
        """Place a goal, or a waypoint, at the start of a drag; it faces the end of the drag."""

    def hold_stick(self, visitor: int, turn: float, forward: float, beat: float) -> None:
        """Note the position of the stick, both -1 to 1; called ten times a second while it is held.

        ``beat`` is the newest heartbeat that the page had seen, a time [s] of the channel's clock.
        """

    def release_stick(self, visitor: int) -> None:
        """Note that this visitor has released the stick."""

    def look(self, visitor: int, view: str) -> None:
        """Move the camera of a visitor to one of ``VIEWS``."""

    def leave(self, visitor: int) -> None:
        """Forget a visitor."""


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
        tasks = [asyncio.create_task(outbox.empty_into(connection))]
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


class _Outbox:
    """The newest message of each kind that is still to be sent."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: dict[str, str] = {}
        self._posted: dict[str, str] = {}
        self._filled = asyncio.Event()

    def post(self, kind: str, text: str) -> None:
        """Have a message sent that differs from the last one of its kind; from any thread, never waits."""
        if self._posted.get(kind) != text and not self._loop.is_closed():
            self._posted[kind] = text
            self._loop.call_soon_threadsafe(self._put, kind, text)

    def _put(self, kind: str, text: str) -> None:
        self._waiting[kind] = text
        self._filled.set()

    async def empty_into(self, connection: Any) -> None:
        """Send what comes, one after the other."""
        from websockets.exceptions import ConnectionClosed

        while True:
            await self._filled.wait()
            self._filled.clear()
            waiting, self._waiting = self._waiting, {}
            for text in waiting.values():
                try:
                    await connection.send(text)
                except ConnectionClosed:
                    return


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


Action: TypeAlias = Callable[[VisitorActions, int], None]


def parsed(message: bytes | str, role: Role) -> Action | None:
    """Return what a message asks for, None where it is wrong or not for this role.

    ``{"point": [u, v]}`` or ``{"point": null}``, ``{"goal": [[u, v], [u, v]]}``, ``{"look": "follow"}``,
    ``{"stick": [turn, forward, beat]}`` or ``{"stick": null}``.
    """
    if not isinstance(message, str) or len(message) > LONGEST:
        return None
    try:
        fields = json.loads(message)
    except (ValueError, RecursionError):
        return None
    if not isinstance(fields, dict) or len(fields) != 1:
        return None
    ((kind, value),) = fields.items()
    if kind not in READERS or (kind in STEERING and role is not Role.STEER):
        return None
    return READERS[kind](value)


def _point(value: Any) -> Action | None:
    if value is None:
        return lambda actions, visitor: actions.point(visitor, None)
    place = _pair(value, 0.0, 1.0)
    return None if place is None else lambda actions, visitor: actions.point(visitor, place)


def _goal(value: Any) -> Action | None:
    if not isinstance(value, list) or len(value) != 2:
        return None
    start, end = (_pair(one, 0.0, 1.0) for one in value)
    if start is None or end is None:
        return None
    return lambda actions, visitor: actions.place_goal(visitor, start, end)


def _stick(value: Any) -> Action | None:
    if value is None:
        return lambda actions, visitor: actions.release_stick(visitor)
    if not isinstance(value, list) or len(value) != 3 or not _is_number(value[2]):
        return None
    stick, beat = _pair(value[:2], -1.0, 1.0), float(value[2])
    return None if stick is None else lambda actions, visitor: actions.hold_stick(visitor, *stick, beat)


def _look(value: Any) -> Action | None:
    if not isinstance(value, str) or value not in VIEWS:
        return None
    return lambda actions, visitor: actions.look(visitor, value)


READERS: dict[str, Callable[[Any], Action | None]] = {"point": _point, "goal": _goal, "stick": _stick, "look": _look}


def _pair(value: Any, low: float, high: float) -> Place | None:
    """Two numbers between ``low`` and ``high``; None for anything else."""
    if not isinstance(value, list) or len(value) != 2:
        return None
    if not all(_is_number(one) and low <= one <= high for one in value):
        return None
    return float(value[0]), float(value[1])


def _is_number(value: Any) -> bool:
    """Whether it is a finite number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= LARGEST
