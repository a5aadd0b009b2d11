"""The parts a ``SimClock`` is made of: its threads as it knows them, their conditions, and their bodies.

Nobody but ``SimClock`` makes these; they share its mutex and its scheduler.
"""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from pathlib import PurePath
from types import TracebackType
from typing import TYPE_CHECKING

from mbf_abstract.compiling.compilation import unwatch_compiler, watch_compiler
from mbf_abstract.time.clock import ThreadDetached

if TYPE_CHECKING:
    from mbf_abstract.time.sim_clock import SimClock

WAITING_MODULES = ("threading.py", "selectors.py", "queue.py")
"""Files of Python's library in which a thread waits for another one."""


class Participant:
    """One known (or, while it waits, one foreign) thread."""

    __slots__ = (
        "baton", "deadlock", "detached", "foreign", "held_locks", "ident", "name", "notified", "outside_depth",
        "priority", "resumed_at", "sections", "ticket", "waiting_on",
    )  # fmt: skip

    def __init__(self, name: str, priority: int, foreign: bool = False) -> None:
        self.name = name
        self.ident = threading.get_ident()  # of the thread that makes it; a SimThread sets its own when it starts
        self.priority = priority
        self.foreign = foreign
        self.baton = threading.Lock()  # released by whoever passes it on, so it is no lock in the usual sense
        self.baton.acquire()
        self.ticket = 0  # grows with every wait: a timer entry of an older wait is stale
        self.notified = False
        self.detached = False
        self.deadlock = False
        self.held_locks = 0
        self.outside_depth = 0  # coroutines of this thread that are outside the lockstep
        self.sections: list[Section] = []  # the guarded ones it is in, the outermost first
        self.resumed_at = 0.0  # wall clock
        self.waiting_on: SimCondition | None = None

    def is_blocked(self) -> bool:
        """Whether it waits for another thread right now, by other means than the clock."""
        frame = sys._current_frames().get(self.ident)
        return frame is not None and PurePath(frame.f_code.co_filename).name in WAITING_MODULES

    def start_counting(self) -> None:
        """Let the hang guard's time begin anew."""
        self.resumed_at = time.monotonic()

    def stop_counting(self) -> None:
        """Let the hang guard wait: the compiler is at work."""
        self.resumed_at = math.inf


class Section:
    """One guarded section, and who is told if its thread hangs. Entered some hundred times a second."""

    __slots__ = ("_clock", "_me", "label", "on_hang")

    def __init__(self, clock: SimClock, label: str, on_hang: Callable[[], None] | None) -> None:
        self._clock = clock
        self.label = label
        self.on_hang = on_hang

    def __enter__(self) -> None:
        self._me = me = self._clock._enter_section(self)
        watch_compiler(me.stop_counting, me.start_counting)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        unwatch_compiler()
        self._clock._leave_section(self, self._me, error)


class SimCondition:
    """A condition of a SimClock; the real lock inside is contended only by foreign threads."""

    __slots__ = ("_clock", "_lock", "waiters")

    def __init__(self, clock: SimClock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self.waiters: list[Participant] = []

    def __enter__(self) -> SimCondition:
        clock = self._clock
        me = clock._current()
        if clock._schedule is not None:
            clock._maybe_yield(me)
        self._lock.acquire()
        me.held_locks += 1
        return self

    def __exit__(self, *exc: object) -> None:
        self._clock._local.participant.held_locks -= 1
        self._lock.release()

    def acquire(self, me: Participant) -> None:
        """Take the real lock for ``me``."""
        self._lock.acquire()
        me.held_locks += 1

    def release(self, me: Participant) -> None:
        """Give the real lock back."""
        me.held_locks -= 1
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait in virtual time; False on a time-out."""
        return self._clock._wait(self, timeout)

    def notify_all(self) -> None:
        """Make all waiters ready."""
        self._clock._notify_all(self)


class SimThread:
    """A thread in lockstep."""

    def __init__(self, clock: SimClock, target: Callable[[], None], name: str, priority: int) -> None:
        self._clock = clock
        self._ended = clock.condition()
        self._alive = True
        self._me = Participant(name, priority)
        self._target = target
        thread = threading.Thread(target=self._run, name=name, daemon=True)
        with clock._mutex:
            clock._known.add(self._me)
            clock._make_ready(self._me)
            if clock._running is None:
                clock._dispatch()
        thread.start()

    @property
    def name(self) -> str:
        """Name of the thread."""
        return self._me.name

    def is_alive(self) -> bool:
        """Whether its body has not ended."""
        return self._alive

    def join(self, timeout: float | None = None) -> bool:
        """Wait for its end in virtual time; return whether it has come."""
        deadline = None if timeout is None else self._clock.now() + timeout
        with self._ended:
            while self._alive:
                remaining = None if deadline is None else deadline - self._clock.now()
                if remaining is not None and remaining <= 0.0:
                    break
                self._ended.wait(remaining)
        return not self._alive

    def _run(self) -> None:
        clock = self._clock
        try:
            clock._enter_thread(self._me)
            self._target()
        except ThreadDetached:
            pass
        finally:
            if self._me.detached:
                clock._go_on_as_foreign(self._me)
            with self._ended:
                self._alive = False
                self._ended.notify_all()
            clock._leave_thread(self._me)
