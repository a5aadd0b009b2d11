"""Lockstep virtual time: the same threads, the same waits, but a run is as fast as the CPU and exactly repeatable.

Every thread of the framework is known to the clock. Exactly one of them runs at a time; when it waits, the clock
hands the baton to the next one in the order (time, priority, sequence), and time jumps to the earliest wake-up once
no thread is ready (``scheduler``). So the same scenario and seed give the same order of events, bit for bit.

Threads the clock does not know (a viewer's callbacks) may call into the framework at any moment: their waits are
served too, but they run beside the lockstep and a run they touch is no longer repeatable.

A plugin call that never waits freezes virtual time. A guard therefore watches the sections marked by ``guarded``: once
the thread has taken ``hang_guard`` real seconds, not counting what other programs took of the processor, it is
*detached*: time goes on without it, and its next call into the clock raises ``ThreadDetached``. Once out of the section
it goes on as a foreign thread, so that it can tidy up.

Use it for simulation and tests. For a real robot use ``WallClock``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mbf_abstract.time.clock import ClockThread, Condition, Priority
from mbf_abstract.time.hang_guard import HangGuard, Section
from mbf_abstract.time.scheduler import STALLED_AFTER, ClockDeadlock, LockstepScheduler
from mbf_abstract.time.sim_thread import SimCondition, SimThread

__all__ = ["DEFAULT_HANG_GUARD", "ClockDeadlock", "SimClock"]

DEFAULT_HANG_GUARD = 30.0


class SimClock(LockstepScheduler):
    """Virtual time for any number of threads; the thread that makes it is the first known one.

    Parameters
    ----------
    hang_guard : float
        Real seconds that a thread may take (``own_time``) in a guarded section, without waiting on the clock, before it
        is detached; 0 = any number.
    schedule : numpy.random.Generator, optional
        Explore interleavings: ready threads are picked at random and every lock may yield. For tests.
    external : bool
        Wait instead of raising ``ClockDeadlock`` when nothing can wake a known thread (a viewer may yet do it).
    """

    def __init__(
        self,
        hang_guard: float = DEFAULT_HANG_GUARD,
        schedule: np.random.Generator | None = None,
        external: bool = False,
    ) -> None:
        super().__init__(schedule, external)
        self._guard = HangGuard(self, hang_guard)
        self.hang_guard = hang_guard

    @property
    def hang_guard(self) -> float:
        """Real seconds after which a guarded section is given up; 0 = never."""
        return self._guard.limit

    @hang_guard.setter
    def hang_guard(self, limit: float) -> None:
        self._guard.limit = limit
        self.stalled_after = min(STALLED_AFTER, limit / 2.0) or STALLED_AFTER

    @property
    def thread_names(self) -> list[str]:
        """Names of all threads in the lockstep, sorted; "main" is the one that made the clock."""
        with self.mutex:
            return sorted(who.name for who in self.known)

    def condition(self) -> Condition:
        """Make a condition whose waiting moves virtual time."""
        return SimCondition(self)

    def spawn(self, target: Callable[[], None], name: str, priority: int = Priority.WORKER) -> ClockThread:
        """Start a daemon thread that joins the lockstep at the present instant."""
        return SimThread(self, target, name, priority)

    def guarded(self, label: str, on_hang: Callable[[], None] | None = None) -> Section:
        """Watch the section with the hang guard, which calls ``on_hang`` on its own thread.

        Sections may lie within each other; the time that counts is that of the outermost one, without what numba's
        compiler took of it.
        """
        return Section(self._guard, label, on_hang)

    def on_founder_alone(self) -> None:
        """End the hang guard's thread."""
        self._guard.stop()
