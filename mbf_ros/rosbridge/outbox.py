"""What waits to be sent to one client. It never makes the robot wait, and never grows without end.

Of a topic the newest messages are kept, as many as its subscription asks for, and of the feedback of a goal the newest
one. Answers are all kept; a client with too many that it does not read is disconnected.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import Hashable

MAX_ANSWERS = 1000


class Outbox:
    """Frames in the order in which they are due; used on the server's event loop only.

    Attributes
    ----------
    overflowed : bool
        Whether more than ``max_answers`` wait; no more answers are taken then.
    """

    def __init__(self, max_answers: int = MAX_ANSWERS) -> None:
        self.overflowed = False
        self._max_answers = max_answers
        self._answers = 0
        self._waiting: OrderedDict[Hashable, deque[str]] = OrderedDict()
        self._ready = asyncio.Event()

    @property
    def is_empty(self) -> bool:
        """Whether all frames have been taken."""
        return not self._waiting

    def answer(self, frame: str) -> None:
        """Add a frame that must not be lost."""
        self._answers += 1
        if self._answers > self._max_answers:
            self.overflowed = True
        else:
            self._waiting[object()] = deque([frame])
        self._ready.set()

    def newest(self, kind: Hashable, frame: str, keep: int = 1) -> None:
        """Add a frame of which only the newest ``keep`` of its kind matter."""
        frames = self._waiting.setdefault(kind, deque())
        while len(frames) >= keep:
            frames.popleft()
        frames.append(frame)
        self._ready.set()

    def forget(self, kind: Hashable) -> None:
        """Drop what waits of a kind."""
        self._waiting.pop(kind, None)

    async def take(self) -> str:
        """Wait for the next frame, one kind after the other."""
        while not self._waiting:
            self._ready.clear()
            await self._ready.wait()
        kind, frames = next(iter(self._waiting.items()))
        frame = frames.popleft()
        if frames:
            self._waiting.move_to_end(kind)
        else:
            del self._waiting[kind]
        if type(kind) is object:
            self._answers -= 1
        return frame
