"""The event bus: hands each event to all sinks, and goes on without one that fails.

Emitting never fails and never waits for more than the sinks' own work; a sink that raises is taken out and the run
goes on (fault table row 28).

Example
-------
>>> bus = EventBus(clock.now, [MemorySink(), JsonLinesSink("runs/1/events.jsonl")])
>>> bus.emit(EventKind.GOAL_ACCEPTED, "get_path", goal_id=7, slot=0)
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable
from typing import Any

from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.event_values import FLOAT_DIGITS, error_text, to_json_value, well_formed
from mbf_abstract.events import Event, EventKind, EventSink
from mbf_abstract.time.program_end import is_for_the_program

_logger = logging.getLogger(__name__)
_logger.addHandler(logging.NullHandler())


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
