"""The wall-clock guard of a simulated run: it detaches a thread that keeps the baton for too long.

The only place where a simulated run may depend on the wall clock.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from mbf_abstract.compiling.compilation import unwatch_compiler, watch_compiler
from mbf_abstract.time.clock import ThreadDetached
from mbf_abstract.time.participant import GuardedSection, Participant
from mbf_abstract.time.scheduler import LockstepScheduler


class HangGuard:
    """Watches the guarded sections of a scheduler's threads, on a thread of its own that starts with the first section.

    Parameters
    ----------
    limit : float
        Wall seconds a guarded section may run without waiting; 0 = for ever.
    """

    def __init__(self, scheduler: LockstepScheduler, limit: float) -> None:
        self.limit = limit
        self._scheduler = scheduler
        self._alone = threading.Event()
        self._running = False

    def enter(self, section: GuardedSection) -> Participant:
        """Begin to watch a section of this thread; returns the thread as a participant."""
        me = self._scheduler.current()
        if not me.sections:
            me.start_counting()
        me.sections.append(section)
        if not self._running:
            self._start()
        return me

    def leave(self, section: GuardedSection, me: Participant, error: BaseException | None) -> None:
        """End the innermost section of ``me``; raises ThreadDetached if the guard has given up on it meanwhile."""
        me.sections.pop()
        if me.detached:
            self._scheduler.go_on_as_foreign(me)
            raise ThreadDetached(section.label)
        if isinstance(error, ThreadDetached):
            raise RuntimeError(f"{section.label} raised ThreadDetached: {error}") from error

    def _start(self) -> None:
        if self.limit > 0.0:
            self._running = True
            self._alone.clear()
            threading.Thread(target=self._watch, name="hang guard", daemon=True).start()

    def stop(self) -> None:
        """End the guard's thread: no thread is left to watch."""
        self._running = False
        self._alone.set()

    def _watch(self) -> None:
        while not self._alone.wait(min(1.0, self.limit / 4.0)):
            for section in self._detach_if_hung():
                if section.on_hang is not None:
                    section.on_hang()

    def _detach_if_hung(self) -> tuple[GuardedSection, ...]:
        """Give up on the running thread if it is due; the sections it hangs in, the outermost first."""
        scheduler = self._scheduler
        with scheduler.mutex:
            suspect = scheduler.running
            if suspect is None or not suspect.sections or suspect is scheduler.founder:
                return ()
            if time.monotonic() - suspect.resumed_at < self.limit:
                return ()
            suspect.detached = True
            scheduler.known.discard(suspect)
            scheduler.running = None
            scheduler.dispatch()
            return tuple(suspect.sections)


class Section:
    """A guarded section as a context manager. Entered some hundred times a second, so it is no generator."""

    __slots__ = ("_guard", "_me", "label", "on_hang")

    def __init__(self, guard: HangGuard, label: str, on_hang: Callable[[], None] | None) -> None:
        self._guard = guard
        self.label = label
        self.on_hang = on_hang

    def __enter__(self) -> None:
        self._me = me = self._guard.enter(self)
        watch_compiler(me.stop_counting, me.start_counting)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        unwatch_compiler()
        self._guard.leave(self, self._me, error)
