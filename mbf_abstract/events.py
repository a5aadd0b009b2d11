"""Events: the typed record of what the framework did, one per step of a goal, and the sinks that keep it.

Every event carries the time of the injected clock, never the wall clock, and plain JSON values only: two runs of the
same seed write the same bytes. Emitting never fails and never waits for more than the sinks' own work; a sink
that raises is taken out and the run goes on (fault table row 28).

Example
-------
>>> bus = EventBus(clock.now, [MemorySink(), JsonLinesSink("runs/1/events.jsonl")])
>>> bus.emit(EventKind.GOAL_ACCEPTED, "get_path", goal_id=7, slot=0)
"""

from __future__ import annotations

import json
import logging
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Protocol, TextIO

from mbf_abstract.event_values import FLOAT_DIGITS, JsonValue, error_text, to_json_value, well_formed
from mbf_abstract.time.clock import is_for_the_program

DEFAULT_MEMORY_EVENTS = 10_000
DEFAULT_MAX_FILE_BYTES = 256 * 1024 * 1024

_logger = logging.getLogger(__name__)
_logger.addHandler(logging.NullHandler())


class EventKind(str, Enum):
    """What happened. Beside each kind: the fields of its ``data``; a kind may carry more."""

    GOAL_ACCEPTED = "goal_accepted"  # goal_id, slot, action-specific summary of the goal
    GOAL_REJECTED = "goal_rejected"  # goal_id, message
    GOAL_STARTED = "goal_started"  # goal_id, slot, plugin
    GOAL_CANCEL = "goal_cancel"  # goal_id, reason
    GOAL_PAUSED = "goal_paused"  # goal_id
    GOAL_RESUMED = "goal_resumed"  # goal_id
    GOAL_FINISHED = "goal_finished"  # goal_id, status, outcome, message
    STATE_CHANGED = "state_changed"  # goal_id, old, new
    PLUGIN_CALL_STARTED = "plugin_call_started"  # goal_id, plugin, method
    PLUGIN_CALL_ENDED = "plugin_call_ended"  # goal_id, plugin, method, outcome, message
    CONTROL_LOOP = "control_loop"  # goal_id, began, cycles, failed; source: plugin; a loop has ended
    PLAN = "plan"  # goal_id, plugin, cost, length, poses (count)
    RECOVERY = "recovery"  # goal_id, plugin, reason
    COMMAND_CLAMPED = "command_clamped"  # requested, sent
    COMMAND_DROPPED = "command_dropped"  # command, reason
    GATE_CLOSED = "gate_closed"  # reason
    ROBOT_STOPPED = "robot_stopped"  # reason; sent by the gate, not by a plugin
    LEASE_GRANTED = "lease_granted"  # holder
    LEASE_REVOKED = "lease_revoked"  # holder, reason
    FAULT = "fault"  # where, type, message, traceback
    QUARANTINE = "quarantine"  # plugin, slot, reason
    STUCK = (
        "stuck"  # place, outcome, failures (count), tried: names, message; the same failure again and again at a place
    )
    TREE = "tree"  # tree, then nodes where a run of it begins, or tick and changes: [index, status, message] of each
    MAP = "map"  # message: what a map server did or found, such as a defect of the mesh it has loaded
    INCIDENT = "incident"  # what, x, y, z, robot_speed; moved, other, other_speed and gap where something was met
    OBJECT = "object"  # number, motion, position, velocity, radius; source: map; a tracked object moves, stops, is gone
    PARAMETER_CHANGED = "parameter_changed"  # name, old, new
    SINK_FAILED = "sink_failed"  # sink, message
    CUSTOM = "custom"  # anything a user or a plugin wants to see in the log


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes
    ----------
    time : float
        Time [s] of the injected clock, rounded to a nanosecond.
    source : str
        Who reports it, e.g. ``"get_path"``, ``"velocity_gate"`` or a plugin's name.
    data : mapping of str to JSON value
        The fields listed at the kind.
    """

    time: float
    kind: EventKind
    source: str
    data: Mapping[str, JsonValue] = field(default_factory=dict)

    def to_json(self) -> str:
        """One line of JSON with sorted keys: equal events give equal text."""
        record = {"time": self.time, "kind": self.kind.value, "source": self.source, "data": self.data}
        return json.dumps(record, sort_keys=True, separators=(",", ":"), allow_nan=False)

    @classmethod
    def from_json(cls, line: str) -> Event:
        """Read a line written by ``to_json``; raises ValueError or KeyError on any other text."""
        record = json.loads(line)
        return cls(record["time"], EventKind(record["kind"]), record["source"], record["data"])


class EventSink(Protocol):
    """Where events go. Both methods are called under the bus's lock, one event at a time; they must not block."""

    def write(self, event: Event) -> None:
        """Take one event; raising takes the sink out of the bus."""

    def close(self) -> None:
        """Finish; idempotent."""


class EventBus:
    """Hands every event to all sinks, in one order for all of them; thread-safe.

    Parameters
    ----------
    now : callable
        Time [s] of the injected clock.
    sinks : iterable of EventSink
        More can be added later.

    Notes
    -----
    A sink that raises is closed and removed; one ``SINK_FAILED`` event informs the others. If no memory sink is left
    to keep the rest of the run, one is added, so the newest events are never lost (``bus.memory``).
    """

    def __init__(self, now: Callable[[], float], sinks: Iterable[EventSink] = ()) -> None:
        self._now = now
        self._sinks = list(sinks)
        self._lock = threading.RLock()  # re-entrant: a failing sink emits SINK_FAILED from within emit

    @property
    def sinks(self) -> tuple[EventSink, ...]:
        """The sinks that still take events."""
        return tuple(self._sinks)

    @property
    def memory(self) -> MemorySink | None:
        """The first memory sink, if there is one."""
        return next((sink for sink in self._sinks if isinstance(sink, MemorySink)), None)

    def add_sink(self, sink: EventSink) -> None:
        """Let ``sink`` take all events from now on."""
        with self._lock:
            self._sinks.append(sink)

    def remove_sink(self, sink: EventSink) -> None:
        """Give ``sink`` no more events; it is not closed. Unknown sinks are ignored."""
        with self._lock:
            if sink in self._sinks:
                self._sinks.remove(sink)

    def emit(self, kind: EventKind, source: str, /, **data: Any) -> None:
        """Record one event, stamped with the clock's time. No sink and no value makes it raise."""
        with self._lock:
            fields = {key: to_json_value(value) for key, value in data.items()}
            event = Event(round(self._now(), FLOAT_DIGITS), kind, well_formed(source), fields)
            for sink in tuple(self._sinks):
                try:
                    sink.write(event)
                except BaseException as error:
                    if is_for_the_program(error):
                        raise
                    self._drop(sink, event, error)

    def close(self) -> None:
        """Close all sinks; events emitted later are lost. Idempotent."""
        with self._lock:
            sinks, self._sinks = self._sinks, []
            for sink in sinks:
                _close_quietly(sink)

    def _drop(self, sink: EventSink, event: Event, error: BaseException) -> None:
        if sink not in self._sinks:
            return
        self._sinks.remove(sink)
        _close_quietly(sink)
        if self.memory is None:
            substitute = MemorySink()
            substitute.write(event)
            self._sinks.append(substitute)
        name = type(sink).__name__
        _logger.warning("event sink %s failed and was removed: %s", name, error_text(error))
        self.emit(EventKind.SINK_FAILED, "event_bus", sink=name, message=f"{type(error).__name__}: {error_text(error)}")


def _close_quietly(sink: EventSink) -> None:
    """Close a sink that may be broken; closing a full disk's file raises once more, which is known already."""
    try:
        sink.close()
    except BaseException as error:
        if is_for_the_program(error):
            raise
        _logger.debug("closing event sink %s failed: %s", type(sink).__name__, error_text(error))


class MemorySink:
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

    def close(self) -> None:
        """Keep what is there."""


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
