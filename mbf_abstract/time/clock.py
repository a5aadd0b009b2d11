"""The one place that reads time and makes threads: ``WallClock`` for a real robot, the ``Clock`` protocol for all.

Every wait of the framework goes through a clock: ``sleep``, ``sleep_until`` and the conditions it makes. That is
what lets ``SimClock`` (module ``sim_clock``) run the same code in lockstep virtual time.

Rules for users of a condition: never sleep, wait on another condition or call a plugin while holding it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from enum import IntEnum
from types import TracebackType
from typing import Protocol

TIME_RESOLUTION = 1e-9
"""Times [s] so near to each other are the same: sums of periods are rounded."""
SIGNAL_PERIOD = 0.5
"""Longest wait [s] of the main thread before Python may handle a signal.

A signal ends a wait only where it comes during it, on that thread: one that comes just before is handled after the
wait, one on Windows too. A Ctrl-C would then do nothing while the run waits for a goal.
"""


class Priority(IntEnum):
    """Who runs first among threads that wake at the same instant; smaller is earlier."""

    SIMULATOR = 0
    WATCHDOG = 10
    CALLBACK = 20
    WORKER = 50
    CLIENT = 90


class ThreadDetached(BaseException):
    """Raised inside a thread that its clock has given up on (see ``SimClock``); it must end, silently.

    Behind the guarded section in which that happened the thread may call into the clock again, to tidy up: it then
    counts as a foreign one.

    A ``BaseException``, so that a plugin's ``except Exception`` does not swallow it.
    """


class Condition(Protocol):
    """A lock with a wait queue, as ``threading.Condition`` but bound to a clock; not re-entrant."""

    def __enter__(self) -> object: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None, /
    ) -> None: ...
    def wait(self, timeout: float | None = None) -> bool:
        """Release the lock, wait for a notification or ``timeout`` [s]; return False on a time-out."""

    def notify_all(self) -> None:
        """Wake all waiters; the caller holds the lock."""


class ClockThread(Protocol):
    """A thread that its clock knows."""

    @property
    def name(self) -> str:
        """Name, for messages."""

    def is_alive(self) -> bool:
        """Whether the thread has not ended."""

    def join(self, timeout: float | None = None) -> bool:
        """Wait for the end at most ``timeout`` [s]; return whether it has come."""


class Clock(Protocol):
    """Time, waiting and threads."""

    def now(self) -> float:
        """Seconds since the clock was made; never runs backwards."""

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds``."""

    def sleep_until(self, stamp: float) -> None:
        """Wait until ``now() >= stamp``."""

    def condition(self) -> Condition:
        """Make a condition whose waiting goes through this clock."""

    def spawn(self, target: Callable[[], None], name: str, priority: int = Priority.WORKER) -> ClockThread:
        """Start a daemon thread that this clock knows."""

    def settle(self) -> None:
        """Let threads that were asked to end do so, where they need this thread to wait for it; moves no time."""

    def guarded(self, label: str, on_hang: Callable[[], None] | None = None) -> AbstractContextManager[None]:
        """Mark foreign code (a plugin call) in which the thread may hang; ``on_hang`` is called if the clock gives up.

        ``ThreadDetached`` leaves the section only where the clock has really given up on the thread; one that the
        foreign code made itself becomes a RuntimeError.
        """

    @contextmanager
    def outside(self) -> Iterator[None]:
        """Leave the lockstep for a while, e.g. to run an asyncio loop; does nothing on a wall clock."""


class _WallThread:
    def __init__(self, target: Callable[[], None], name: str) -> None:
        self._thread = threading.Thread(target=target, name=name, daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        return self._thread.name

    def is_alive(self) -> bool:
        return self._thread.is_alive()

    def join(self, timeout: float | None = None) -> bool:
        self._thread.join(None if timeout is None else min(timeout, threading.TIMEOUT_MAX))
        return not self._thread.is_alive()


class _WallCondition(threading.Condition):
    """A condition that takes any timeout; the operating system takes some 290 years, and infinity not at all.

    Without a timeout the main thread may wake although nobody has notified it, see ``SIGNAL_PERIOD``.
    """

    def wait(self, timeout: float | None = None) -> bool:
        if timeout is None and threading.current_thread() is threading.main_thread():
            super().wait(SIGNAL_PERIOD)
            return True
        return super().wait(None if timeout is None else min(timeout, threading.TIMEOUT_MAX))


class _WallSection:
    """A guarded section on the wall clock, whose thread is never given up. Entered some hundred times a second."""

    __slots__ = ("label",)

    def __init__(self, label: str) -> None:
        self.label = label

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if isinstance(error, ThreadDetached):
            raise RuntimeError(f"{self.label} raised ThreadDetached: {error}") from error


class WallClock:
    """Real time, from the operating system's monotonic clock."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.monotonic() - self._start

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds``; returns at once where it is not positive."""
        if seconds > 0.0:
            time.sleep(min(seconds, threading.TIMEOUT_MAX))

    def sleep_until(self, stamp: float) -> None:
        """Wait until ``now() >= stamp``."""
        self.sleep(stamp - self.now())

    def condition(self) -> Condition:
        """Make a ``threading.Condition`` with a plain lock."""
        return _WallCondition(threading.Lock())

    def spawn(self, target: Callable[[], None], name: str, priority: int = Priority.WORKER) -> ClockThread:
        """Start a daemon thread; the priority means nothing to the operating system."""
        return _WallThread(target, name)

    def settle(self) -> None:
        """Do nothing: threads end by themselves."""

    def guarded(self, label: str, on_hang: Callable[[], None] | None = None) -> AbstractContextManager[None]:
        """Do nothing: a thread that hangs does not stop real time."""
        return _WallSection(label)

    @contextmanager
    def outside(self) -> Iterator[None]:
        """Do nothing: there is no lockstep to leave."""
        yield


def wall_seconds() -> float:
    """Read the wall clock [s, arbitrary origin], for reports of how long something took, never for decisions."""
    return time.perf_counter()


def unix_seconds() -> float:
    """Read the calendar [s since 1970], for stamps that other programs read; it may be set back while we run."""
    return time.time()


class Stopwatch:
    """Time that passes on a clock while not paused; the base of patience, oscillation and progress checks."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._started = clock.now()
        self._paused_at: float | None = None

    def restart(self) -> None:
        """Begin again at zero, keeping the pause state."""
        self._started = self._clock.now()
        if self._paused_at is not None:
            self._paused_at = self._started

    def pause(self) -> None:
        """Stop counting; idempotent."""
        if self._paused_at is None:
            self._paused_at = self._clock.now()

    def resume(self) -> None:
        """Count on; idempotent."""
        if self._paused_at is not None:
            self._started += self._clock.now() - self._paused_at
            self._paused_at = None

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._paused_at is not None

    @property
    def elapsed(self) -> float:
        """Seconds counted so far."""
        end = self._clock.now() if self._paused_at is None else self._paused_at
        return end - self._started
