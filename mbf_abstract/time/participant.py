"""The state of one thread in the lockstep scheduler."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Callable
from pathlib import PurePath
from types import FrameType
from typing import Protocol

WAITING_MODULES = ("threading.py", "selectors.py", "queue.py")
"""Files of Python's library in which a thread waits for another one."""


def frames_of_threads() -> dict[int, FrameType]:
    """What every thread is at, by its identifier.

    Python before 3.12 holds a lock of its own meanwhile (gh-106883). Garbage collected then may run any code and let
    another thread begin or end, which waits for that lock: all threads stand for ever. So none is collected.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        return sys._current_frames()
    finally:
        if collects:
            gc.enable()


class GuardedSection(Protocol):
    """One guarded section, and who is called if its thread hangs."""

    @property
    def label(self) -> str:
        """What runs in it, for messages."""

    @property
    def on_hang(self) -> Callable[[], None] | None:
        """Called by the guard if the thread hangs."""


class Participant:
    """One known (or, while it waits, one foreign) thread."""

    __slots__ = (
        "baton", "deadlock", "detached", "foreign", "held_locks", "ident", "is_timed", "name", "native_id", "notified",
        "outside_depth", "priority", "sections", "ticket", "waiting_among", "work",
    )  # fmt: skip

    def __init__(self, name: str, priority: int, foreign: bool = False) -> None:
        self.name = name
        self.run_on_this_thread()  # the one that makes it; a SimThread does so again when it starts
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
        self.sections: list[GuardedSection] = []  # the guarded ones it is in, the outermost first
        self.is_timed = False  # whether the hang guard counts
        self.work = 0  # grows when it begins to count anew
        self.waiting_among: list[Participant] | None = None  # the waiters of the condition it waits on

    def run_on_this_thread(self) -> None:
        """Be the thread that calls this."""
        self.ident, self.native_id = threading.get_ident(), threading.get_native_id()

    def leave_waiters(self) -> None:
        """Wait on no condition any more; the scheduler's mutex is held."""
        if self.waiting_among is not None:
            self.waiting_among.remove(self)
            self.waiting_among = None

    def is_blocked(self) -> bool:
        """Whether it waits for another thread right now, by other means than the clock."""
        frame = frames_of_threads().get(self.ident)
        return frame is not None and PurePath(frame.f_code.co_filename).name in WAITING_MODULES

    def start_counting(self) -> None:
        """Let the hang guard's time begin anew."""
        self.work += 1
        self.is_timed = True

    def stop_counting(self) -> None:
        """Let the hang guard wait: the compiler is at work, or it is another thread's turn."""
        self.is_timed = False
