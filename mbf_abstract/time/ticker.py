"""A task that runs at a fixed rate on its own thread, e.g. the update of a map."""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock, Priority


class Ticker:
    """Calls ``task`` every ``period`` seconds until stopped; a task that raises is reported and tried again."""

    def __init__(self, clock: Clock, events: EventBus, task: Callable[[], None], period: float, name: str) -> None:
        self._clock = clock
        self._events = events
        self._task = task
        self._period = period
        self._name = name
        self._condition = clock.condition()
        self._stopped = False
        clock.spawn(self._loop, name, Priority.WATCHDOG)

    def stop(self) -> None:
        """End the thread after the present call; never waits."""
        with self._condition:
            self._stopped = True
            self._condition.notify_all()

    def _loop(self) -> None:
        due = self._clock.now()
        while not self._stopped:
            try:
                self._task()
            except BaseException as error:  # also a layer's sys.exit()
                self._events.emit(EventKind.FAULT, self._name, type=type(error).__name__, message=error_text(error))
            due = max(due + self._period, self._clock.now())
            with self._condition:
                while not self._stopped and self._clock.now() < due - TIME_RESOLUTION:
                    self._condition.wait(due - self._clock.now())
