"""Lockstep virtual time: the same threads, the same waits, but a run is as fast as the CPU and exactly repeatable.

Every thread of the framework is known to the clock. Exactly one of them runs at a time; when it waits, the clock
hands the baton to the next one in the order (time, priority, sequence), and time jumps to the earliest wake-up once
nobody is ready. So the same scenario and seed give the same order of events, bit for bit.

Threads the clock does not know (a viewer's callbacks) may call into the framework at any moment: their waits are
served too, but they run beside the lockstep and a run they touch is no longer repeatable.

A plugin call that never waits freezes virtual time. A wall-clock guard therefore watches the sections marked by
``guarded``: after ``hang_guard`` wall seconds the thread is *detached*: time goes on without it, and its next call into
the clock raises ``ThreadDetached``. Once out of the section it goes on as a foreign thread, so that it can tidy up.
This guard is the only place where a simulated run depends on the wall clock.

Use it for simulation and tests. For a real robot use ``WallClock``.
"""

from __future__ import annotations

import heapq
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from mbf_abstract.time.clock import ClockThread, Condition, Priority, ThreadDetached
from mbf_abstract.time.sim_thread import Participant, Section, SimCondition, SimThread

DEFAULT_HANG_GUARD = 30.0
STALLED_AFTER = 5.0  # real seconds; half the hang guard's, if that is less


class ClockDeadlock(RuntimeError):
    """A wait can never end: nobody is left to notify it, or who should move time waits for something else."""


class SimClock:
    """Virtual time for any number of threads; the thread that makes it is the first known one.

    Parameters
    ----------
    hang_guard : float
        Wall seconds a guarded section may run without waiting before its thread is detached; 0 = never.
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
        self._mutex = threading.Lock()
        self._now = 0.0
        self._sequence = 0
        self._turns = 0  # how often the baton was handed on
        self._ready: list[tuple[int, int, Participant]] = []
        self._timers: list[tuple[float, int, int, int, Participant]] = []
        self._local = threading.local()
        self._founder = Participant("main", Priority.CLIENT)
        self._local.participant = self._founder
        self._running: Participant | None = self._founder
        self._known: set[Participant] = {self._founder}
        self._outside = 0
        self.hang_guard = hang_guard
        self._guarding = False
        self._alone = threading.Event()
        self._schedule = schedule
        self._external = external

    # ------------------------------------------------------------------------------------------- public
    def now(self) -> float:
        """Virtual seconds since the clock was made."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of virtual time; zero or less lets the others of this instant run first."""
        self.sleep_until(self._after(seconds))

    def sleep_until(self, stamp: float) -> None:
        """Wait until virtual time ``stamp``."""
        me = self._current()
        self._forbid_waiting_with_lock(me, 0)
        with self._mutex:
            me.notified = False
            self._add_timer(me, max(stamp, self._now))
            self._release_baton(me)
        self._await_baton(me)

    def settle(self) -> None:
        """Let all that is ready at this instant run, if it is this thread's turn; moves no time."""
        me = self._current()
        if self._running is me and not me.held_locks:
            self.sleep(0.0)

    def condition(self) -> Condition:
        """Make a condition whose waiting moves virtual time."""
        return SimCondition(self)

    def spawn(self, target: Callable[[], None], name: str, priority: int = Priority.WORKER) -> ClockThread:
        """Start a daemon thread that joins the lockstep at the present instant."""
        return SimThread(self, target, name, priority)

    def guarded(self, label: str, on_hang: Callable[[], None] | None = None) -> Section:
        """Watch the section with the wall-clock guard, which calls ``on_hang`` on its own thread.

        Sections may lie within each other; the time that counts is that of the outermost one, without what numba's
        compiler took of it.
        """
        return Section(self, label, on_hang)

    def _enter_section(self, section: Section) -> Participant:
        me = self._current()
        if not me.sections:
            me.start_counting()
        me.sections.append(section)
        if not self._guarding:
            self._start_guard()
        return me

    def _leave_section(self, section: Section, me: Participant, error: BaseException | None) -> None:
        me.sections.pop()
        if me.detached:
            self._go_on_as_foreign(me)
            raise ThreadDetached(section.label)
        if isinstance(error, ThreadDetached):
            raise RuntimeError(f"{section.label} raised ThreadDetached: {error}") from error

    def _go_on_as_foreign(self, me: Participant) -> None:
        if self._local.participant is me:
            self._local.participant = Participant(me.name, me.priority, foreign=True)

    @contextmanager
    def outside(self) -> Iterator[None]:
        """Give up the baton while the body runs; on return wait for a turn.

        Several coroutines of one thread may be inside at once, entered and left in any order: the thread counts as
        foreign until the last of them is back.
        """
        me = self._current()
        self._leave_lockstep(me)
        try:
            yield
        finally:
            self._join_lockstep(me)

    def _leave_lockstep(self, me: Participant) -> None:
        with self._mutex:
            me.outside_depth += 1
            if me.outside_depth > 1 or me not in self._known:
                return
            me.foreign = True
            self._outside += 1
            self._running = None
            self._dispatch()

    def _join_lockstep(self, me: Participant) -> None:
        with self._mutex:
            me.outside_depth -= 1
            if me.outside_depth > 0 or me not in self._known:
                return
            me.foreign = False
            self._outside -= 1
            self._make_ready(me)
            if self._running is None:
                self._dispatch()
        self._await_baton(me)

    # -------------------------------------------------------------------------------- waiting and waking
    def _wait(self, condition: SimCondition, timeout: float | None) -> bool:
        me = self._current()
        self._forbid_waiting_with_lock(me, 1)
        with self._mutex:
            me.notified = False
            me.waiting_on = condition
            condition.waiters.append(me)
            if timeout is not None and timeout < math.inf:
                self._add_timer(me, self._after(timeout))
            else:
                me.ticket += 1
            condition.release(me)
            self._release_baton(me)
        try:
            self._await_baton(me)
        finally:
            condition.acquire(me)
        return me.notified

    def _after(self, seconds: float) -> float:
        """Stamp ``seconds`` from now; later than now for any positive number, or who waits again would never end."""
        stamp = self._now + max(0.0, seconds)
        return math.nextafter(self._now, math.inf) if stamp == self._now and seconds > 0.0 else stamp

    def _notify_all(self, condition: SimCondition) -> None:
        with self._mutex:
            waiters, condition.waiters = condition.waiters, []
            for waiter in waiters:
                waiter.notified = True
                waiter.waiting_on = None
                self._make_ready(waiter)
            if waiters and self._running is None:
                self._dispatch()

    def _maybe_yield(self, me: Participant) -> None:
        """Explore: let another ready thread run before a lock is taken."""
        if self._schedule is None or me.foreign or me.held_locks:
            return
        with self._mutex:
            if not self._ready or self._schedule.random() < 0.5:
                return
            self._make_ready(me)
            self._release_baton(me)
        self._await_baton(me)

    # ------------------------------------------------------------------------------ the scheduler itself
    def _current(self) -> Participant:
        try:
            me: Participant = self._local.participant
        except AttributeError:  # a thread that this clock has not seen yet
            me = Participant(threading.current_thread().name, Priority.CLIENT, foreign=True)
            self._local.participant = me
        if me.detached:
            raise ThreadDetached(me.name)
        return me

    def _add_timer(self, me: Participant, stamp: float) -> None:
        me.ticket += 1
        self._sequence += 1
        heapq.heappush(self._timers, (stamp, me.priority, self._sequence, me.ticket, me))

    def _make_ready(self, who: Participant) -> None:
        who.ticket += 1
        self._sequence += 1
        heapq.heappush(self._ready, (who.priority, self._sequence, who))

    def _release_baton(self, me: Participant) -> None:
        """Pass the baton on, mutex held; a foreign thread has none but may have to start an idle clock."""
        if not me.foreign:
            self._running = None
        if self._running is None:
            self._dispatch()

    def _await_baton(self, me: Participant) -> None:
        if me.foreign:
            self._await_beside(me)
        else:
            me.baton.acquire()
        if me.sections:
            me.start_counting()
        if me.detached:
            raise ThreadDetached(me.name)
        if me.deadlock:
            me.deadlock = False
            raise ClockDeadlock(self._describe_waiters())

    def _await_beside(self, me: Participant) -> None:
        """Wait as a foreign thread; raises ClockDeadlock where the one whose turn it is does not use the clock."""
        limit, turns = min(STALLED_AFTER, self.hang_guard / 2.0) or STALLED_AFTER, self._turns
        while not me.baton.acquire(timeout=limit):
            with self._mutex:
                holder, stalled = self._running, turns == self._turns
                turns = self._turns
                if holder is None or not stalled or not holder.is_blocked():
                    continue
                if me.baton.acquire(blocking=False):  # handed on in the very last moment
                    return
                self._withdraw(me)
            raise ClockDeadlock(
                f"thread {me.name!r} waits on the clock for thread {holder.name!r}, which waits for another thread "
                "by other means, so that time stands still; let it do so within `with clock.outside():`"
            )

    def _withdraw(self, me: Participant) -> None:
        """Forget a wait that has not ended; mutex held."""
        me.ticket += 1
        if me.waiting_on is not None:
            me.waiting_on.waiters.remove(me)
            me.waiting_on = None

    def _dispatch(self) -> None:
        """Choose who runs next, moving time if nobody is ready; mutex held, nobody running."""
        while True:
            if not self._ready and not self._advance_time():
                self._report_deadlock()
                if not self._ready:
                    return
            nxt = self._pop_ready()
            if nxt.detached:
                continue
            if not nxt.foreign:
                self._running = nxt
                self._turns += 1
                nxt.baton.release()
                return
            nxt.baton.release()  # a foreign thread goes its way beside the lockstep

    def _pop_ready(self) -> Participant:
        if self._schedule is not None and len(self._ready) > 1:
            index = int(self._schedule.integers(len(self._ready)))
            entry = self._ready.pop(index)
            heapq.heapify(self._ready)
            return entry[2]
        return heapq.heappop(self._ready)[2]

    def _advance_time(self) -> bool:
        """Jump to the earliest wake-up and make everyone due then ready; False if there is none."""
        while self._timers and self._timers[0][3] != self._timers[0][4].ticket:
            heapq.heappop(self._timers)
        if not self._timers:
            return False
        self._now = max(self._now, self._timers[0][0])
        while self._timers and self._timers[0][0] <= self._now:
            _, _, _, ticket, who = heapq.heappop(self._timers)
            if ticket != who.ticket:
                continue
            if who.waiting_on is not None:
                who.waiting_on.waiters.remove(who)
                who.waiting_on = None
            self._make_ready(who)
        return True

    def _report_deadlock(self) -> None:
        founder = self._founder
        if self._external or self._outside or founder.waiting_on is None:
            return
        founder.waiting_on.waiters.remove(founder)
        founder.waiting_on = None
        founder.deadlock = True
        self._make_ready(founder)

    def _describe_waiters(self) -> str:
        names = sorted(p.name for p in self._known if p is not self._founder)
        return f"at t={self._now:.3f} s every thread waits for another one: main, {', '.join(names) or 'nobody else'}"

    def _forbid_waiting_with_lock(self, me: Participant, allowed: int) -> None:
        if me.held_locks > allowed:
            raise RuntimeError(f"thread {me.name!r} waits while it holds {me.held_locks - allowed} more condition(s)")

    # ----------------------------------------------------------------------------------- threads, guard
    def _enter_thread(self, me: Participant) -> None:
        self._local.participant = me
        me.ident = threading.get_ident()
        self._await_baton(me)

    def _leave_thread(self, me: Participant) -> None:
        with self._mutex:
            self._known.discard(me)
            if self._known <= {self._founder}:
                self._guarding = False
                self._alone.set()
            if self._running is me:
                self._running = None
                self._dispatch()

    def _start_guard(self) -> None:
        if self.hang_guard > 0.0:
            self._guarding = True
            self._alone.clear()
            threading.Thread(target=self._guard, name="hang guard", daemon=True).start()

    def _guard(self) -> None:
        """Look for hung threads until only the founder is left."""
        while not self._alone.wait(min(1.0, self.hang_guard / 4.0)):
            for section in self._detach_if_hung():
                if section.on_hang is not None:
                    section.on_hang()

    def _detach_if_hung(self) -> tuple[Section, ...]:
        """Give up on the running thread if it is due; the sections it hangs in, the outermost first."""
        with self._mutex:
            suspect = self._running
            if suspect is None or not suspect.sections or suspect is self._founder:
                return ()
            if time.monotonic() - suspect.resumed_at < self.hang_guard:
                return ()
            suspect.detached = True
            self._known.discard(suspect)
            self._running = None
            self._dispatch()
            return tuple(suspect.sections)
