"""The guard of a simulated run: it detaches a thread that keeps the baton for too long.

The only place where a simulated run may depend on the real clock. What counts is the time that the thread took by
itself (``own_time``), so a run does not depend on what else the machine has to do, only on how fast it is.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType

from mbf_abstract.compiling.compilation import unwatch_compiler, watch_compiler
from mbf_abstract.time.clock import ThreadDetached
from mbf_abstract.time.own_time import OwnTime
from mbf_abstract.time.participant import GuardedSection, Participant
from mbf_abstract.time.scheduler import LockstepScheduler


class HangGuard:
    """Watches the guarded sections of a scheduler's threads, on a thread of its own that starts with the first section.

    Parameters
    ----------
    limit : float
        Seconds a guarded section may take without waiting on the clock; 0 = any number.
    """

    def __init__(self, scheduler: LockstepScheduler, limit: float) -> None:
        self.limit = limit
        self._scheduler = scheduler
        self._own_time = OwnTime()
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
        while not self._alone.wait(period := min(1.0, self.limit / 4.0)):
            for section in self._detach_if_hung(2.0 * period):
                if section.on_hang is not None:
                    section.on_hang()

    def _detach_if_hung(self, longest: float) -> tuple[GuardedSection, ...]:
        """Give up on the running thread if it is due; the sections it hangs in, the outermost first.

        At most ``longest`` [s] count since the last call.
        """
        scheduler = self._scheduler
        with scheduler.mutex:
            suspect = scheduler.running
            if suspect is None or not (suspect.sections and suspect.is_timed) or suspect is scheduler.founder:
                return ()
            if self._own_time.look(suspect.native_id, suspect.work, longest) < self.limit:
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
