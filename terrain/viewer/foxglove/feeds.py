"""Parts of what happens in a run, for the server."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from mbf_abstract.events import Event, EventSink
from terrain.recording.recorder import Taken
from terrain.recording.recording import Recording
from terrain.session.session import Session

MAX_EVENTS = 10_000  # that wait for the next part


class EventQueue(EventSink):
    """A sink that keeps events until the next part; the oldest are dropped."""

    def __init__(self, earlier: Iterable[Event] = ()) -> None:
        self._events = deque(earlier, maxlen=MAX_EVENTS)

    def write(self, event: Event) -> None:
        """Take one event."""
        self._events.append(event)

    def take(self) -> list[Event]:
        """Return what has come since the last part."""
        return [self._events.popleft() for _ in range(len(self._events))]


class RunFeed:
    """Parts of a run, from its recorder; used on the simulator's thread."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._taken = Taken()
        self._events = EventQueue(session.memory.events)
        session.events.add_sink(self._events)

    def close(self) -> None:
        """Take no more events."""
        self._session.events.remove_sink(self._events)

    def part(self) -> Recording:
        """Return what has come since the last part."""
        session = self._session
        part, self._taken = session.recorder.since(self._taken, self._events.take(), session.loop.origin)
        return part
