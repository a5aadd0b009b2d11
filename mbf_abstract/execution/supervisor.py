"""One thread that looks after all running plugin calls: patience, and the grace after a cancel.

A *watch* is a function that does what is due and answers in how many seconds it wants to be asked again (None =
never). It runs on the supervisor's thread and must be short.
"""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.clock import Clock, Priority

Check = Callable[[], float | None]


class Watch:
    """One registered check; keep it to poke or stop it."""

    __slots__ = ("check", "due")

    def __init__(self, check: Check, due: float) -> None:
        self.check = check
        self.due = due


class Supervisor:
    """Runs checks at the times they ask for."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._condition = clock.condition()
        self._watches: list[Watch] = []
        self._wake_at = float("inf")
        self._closed = False
        clock.spawn(self._loop, "supervisor", Priority.WATCHDOG)

    def watch(self, check: Check, first_in: float) -> Watch:
        """Ask ``check`` for the first time in ``first_in`` seconds."""
        watch = Watch(check, self._clock.now() + first_in)
        with self._condition:
            self._watches.append(watch)
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

    def close(self) -> None:
        """End the thread."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

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
                again = watch.check()
                if again is None:
                    self.stop(watch)
                else:
                    self._ask_again(watch, again)

    def _ask_again(self, watch: Watch, seconds: float) -> None:
        with self._condition:  # a poke that came during the check has set an earlier time: keep it
            watch.due = min(watch.due, self._clock.now() + seconds)

    def _next_due(self) -> list[Watch] | None:
        """Wait until at least one watch is due; None = closed."""
        with self._condition:
            while not self._closed:
                now = self._clock.now()
                due = [watch for watch in self._watches if watch.due <= now + 1e-9]
                if due:
                    return due
                self._wake_at = min((watch.due for watch in self._watches), default=float("inf"))
                self._condition.wait(None if self._wake_at == float("inf") else self._wake_at - now)
            return None
