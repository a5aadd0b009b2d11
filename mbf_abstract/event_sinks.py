"""The sinks that keep events: in memory, and in a file of JSON lines."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from mbf_abstract.events import Event, EventKind, EventSink

DEFAULT_MEMORY_EVENTS = 10_000


DEFAULT_MAX_FILE_BYTES = 256 * 1024 * 1024


class MemorySink(EventSink):
    """Keeps the newest ``maxlen`` events; for tests, notebooks and as the substitute of a broken file."""

    def __init__(self, maxlen: int = DEFAULT_MEMORY_EVENTS) -> None:
        self._events: deque[Event] = deque(maxlen=maxlen)
        self._lock = threading.Lock()

    @property
    def events(self) -> tuple[Event, ...]:
        """The kept events, oldest first."""
        with self._lock:  # a deque cannot be read while another thread writes
            return tuple(self._events)

    def of_kind(self, *kinds: EventKind) -> tuple[Event, ...]:
        """Return the kept events of the given kinds, oldest first."""
        return tuple(event for event in self.events if event.kind in kinds)

    def write(self, event: Event) -> None:
        """Keep one event, forgetting the oldest if full."""
        with self._lock:
            self._events.append(event)


class JsonLinesSink:
    """Writes one JSON object a line; the bytes depend on the events only.

    Parameters
    ----------
    path : path-like
        File to write, opened (and overwritten) at the first event; its folder is made.
    max_bytes : int
        Size at which the file counts as full.

    Notes
    -----
    ``write`` raises OSError on a full disk, a read-only folder or a file of ``max_bytes``; the bus then keeps the
    rest of the run in memory.
    """

    def __init__(self, path: str | os.PathLike[str], max_bytes: int = DEFAULT_MAX_FILE_BYTES) -> None:
        self.path = Path(path)
        self.max_bytes = max_bytes
        self._written = 0
        self._file: TextIO | None = None
        self._closed = False

    def write(self, event: Event) -> None:
        """Append one event; each line reaches the file at once, so a crash loses nothing."""
        line = event.to_json() + "\n"
        if self._written + len(line) > self.max_bytes:
            raise OSError(f"{self.path} has reached its limit of {self.max_bytes} bytes")
        if self._closed:
            raise OSError(f"{self.path} is closed")
        if self._file is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("w", encoding="ascii", newline="\n", buffering=1)
        self._file.write(line)
        self._written += len(line)

    def close(self) -> None:
        """Close the file; later events are refused."""
        self._closed = True
        if self._file is not None:
            file, self._file = self._file, None
            file.close()


def read_events(path: str | os.PathLike[str]) -> Iterator[Event]:
    """Yield the events of a file written by ``JsonLinesSink``; raises OSError, or ValueError naming the line."""
    with Path(path).open(encoding="ascii") as file:
        for number, line in enumerate(file, start=1):
            try:
                yield Event.from_json(line)
            except (ValueError, KeyError, TypeError) as error:
                raise ValueError(f"{path}:{number}: not an event: {error}") from error
