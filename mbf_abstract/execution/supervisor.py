"""One thread that looks after all running plugin calls: patience, and the grace after a cancel.

A *check* is a function that does what is due and returns in how many seconds it is to be called again (None = never).
It runs on the supervisor's thread and must be short. One that raises, e.g. because no more threads can be made, is
reported and called again a little later: the end of every goal depends on this thread.
"""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock, Priority

Check = Callable[[], float | None]

RETRY = 0.1  # s until a check that has raised is asked again


def _nothing_due() -> None:
    """Take the place of a check that is forgotten: its owner keeps the watch, and would keep itself by the check."""


class Watch:
    """One registered check; keep it to poke or stop it."""

    __slots__ = ("check", "due")

    def __init__(self, check: Check, due: float) -> None:
        self.check = check
        self.due = due


class Supervisor:
    """Runs checks at the times they ask for."""

    def __init__(self, clock: Clock, events: EventBus) -> None:
        self._clock = clock
        self._events = events
        self._condition = clock.condition()
        self._watches: list[Watch] = []
        self._wake_at = float("inf")
        self._closed = False
        self._serving = False
        self._serve()

    def watch(self, check: Check, first_in: float) -> Watch:
        """Ask ``check`` for the first time in ``first_in`` seconds."""
        watch = Watch(check, self._clock.now() + first_in)
        with self._condition:
            self._watches.append(watch)
            self._serve()
            self._wake_for(watch)
        return watch

    def poke(self, watch: Watch) -> None:
        """Ask this check as soon as possible."""
        with self._condition:
            if watch in self._watches:
                watch.due = self._clock.now()
                self._wake_for(watch)

    def stop(self, watch: Watch) -> None:
        """Forget a watch; idempotent. A check that is running right now ends normally."""
        with self._condition:
            if watch in self._watches:
                self._watches.remove(watch)
                watch.check = _nothing_due
                if self._closed and not self._watches:
                    self._condition.notify_all()

    def close(self) -> None:
        """End the thread once nothing is left to be watched: a goal that still runs has its end coming."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    def _serve(self) -> None:
        """Make sure that a thread asks the checks."""
        if not self._serving:
            self._serving = True
            self._clock.spawn(self._loop, "supervisor", Priority.WATCHDOG)

    def _wake_for(self, watch: Watch) -> None:
        if watch.due < self._wake_at:
            self._condition.notify_all()

    def _loop(self) -> None:
        while True:
            due = self._next_due()
            if due is None:
                return
            for watch in due:
                watch.due = float("inf")
                again = self._ask(watch)
                if again is None:
                    self.stop(watch)
                else:
                    self._ask_again(watch, again)

    def _ask(self, watch: Watch) -> float | None:
        try:
            return watch.check()
        except BaseException as error:
            text = error_text(error)
            self._events.emit(EventKind.FAULT, "supervisor", type=type(error).__name__, message=text)
            return RETRY

    def _ask_again(self, watch: Watch, seconds: float) -> None:
        with self._condition:  # a poke that came during the check has set an earlier time: keep it
            watch.due = min(watch.due, self._clock.now() + seconds)

    def _next_due(self) -> list[Watch] | None:
        """Wait until at least one watch is due; None = closed, and nothing is left to be watched."""
        with self._condition:
            while self._watches or not self._closed:
                now = self._clock.now()
                due = [watch for watch in self._watches if watch.due <= now + TIME_RESOLUTION]
                if due:
                    return due
                self._wake_at = min((watch.due for watch in self._watches), default=float("inf"))
                self._condition.wait(None if self._wake_at == float("inf") else self._wake_at - now)
            self._serving = False
            return None
