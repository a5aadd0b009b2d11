"""What waits to be sent to the other end of a connection. It never makes the robot wait, and never grows without end.

Of a topic the newest messages are kept, as many as its subscription asks for, and of the feedback of a goal the newest
one. Answers are all kept, up to a limit; who lets more than that wait is disconnected.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import Hashable
from contextlib import suppress
from typing import Any

Frame = str | bytes
"""A text or a binary frame of a WebSocket."""

MAX_ANSWERS = 1000


class WaitingFrames:
    """Frames in the order in which they are due; used by one thread at a time.

    Attributes
    ----------
    overflowed : bool
        Whether more than ``MAX_ANSWERS`` wait; no more answers are taken then.
    """

    def __init__(self) -> None:
        self.overflowed = False
        self._answers = 0
        self._waiting: OrderedDict[Hashable, deque[Frame]] = OrderedDict()

    @property
    def is_empty(self) -> bool:
        """Whether all frames have been taken."""
        return not self._waiting

    def answer(self, frame: Frame) -> None:
        """Add a frame that must not be lost."""
        self._answers += 1
        if self._answers > MAX_ANSWERS:
            self.overflowed = True
        else:
            self._waiting[object()] = deque([frame])

    def newest(self, kind: Hashable, frame: Frame, keep: int = 1) -> None:
        """Add a frame of which only the newest ``keep`` of its kind matter."""
        frames = self._waiting.setdefault(kind, deque())
        while len(frames) >= keep:
            frames.popleft()
        frames.append(frame)

    def forget(self, kind: Hashable) -> None:
        """Drop what waits of a kind."""
        self._waiting.pop(kind, None)

    def pop(self) -> Frame:
        """Return the next frame, one kind after the other; raises StopIteration where none waits."""
        kind, frames = next(iter(self._waiting.items()))
        frame = frames.popleft()
        if frames:
            self._waiting.move_to_end(kind)
        else:
            del self._waiting[kind]
        if type(kind) is object:
            self._answers -= 1
        return frame


class Outbox(WaitingFrames):
    """What waits for one client of the server; used on the server's event loop only."""

    def __init__(self) -> None:
        super().__init__()
        self._ready = asyncio.Event()

    def answer(self, frame: Frame) -> None:
        """Add a frame that must not be lost."""
        super().answer(frame)
        self._ready.set()

    def newest(self, kind: Hashable, frame: Frame, keep: int = 1) -> None:
        """Add a frame of which only the newest ``keep`` of its kind matter."""
        super().newest(kind, frame, keep)
        self._ready.set()

    async def take(self) -> Frame:
        """Wait for the next frame."""
        while self.is_empty:
            self._ready.clear()
            await self._ready.wait()
        return self.pop()

    async def send_to(self, connection: Any) -> None:
        """Send what comes until the connection is closed.

        ``send`` waits for a client that reads slowly, and nobody waits for ``send``.
        """
        from websockets.exceptions import ConnectionClosed

        with suppress(ConnectionClosed):
            while True:
                await connection.send(await self.take())
