"""The lockstep scheduler: which thread runs next, and when virtual time moves.

Exactly one known thread runs at a time: the one that has the baton. When it waits, the baton goes to the next thread
in the order (time, priority, sequence), and time jumps to the earliest wake-up once no thread is ready. Threads the
scheduler does not know are served beside the lockstep.

``SimClock`` adds threads, conditions and the hang guard to it. Use that.
"""

from __future__ import annotations

import heapq
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from mbf_abstract.time.clock import SIGNAL_PERIOD, Priority, ThreadDetached
from mbf_abstract.time.participant import Participant

STALLED_AFTER = 5.0
"""Wall seconds after which a foreign thread that waits for its turn looks whether time stands still for good."""


class ClockDeadlock(RuntimeError):
    """A wait can never end: no thread is left to notify it, or the one that should move time waits by other means."""


class LockstepScheduler:
    """Virtual time and the baton.

    Parameters
    ----------
    schedule : numpy.random.Generator, optional
        Explore interleavings: ready threads are picked at random and every lock may yield.
    external : bool
        Wait instead of raising ``ClockDeadlock`` when nothing can wake a known thread.
    """

    def __init__(self, schedule: np.random.Generator | None, external: bool) -> None:
        self.mutex = threading.Lock()
        self.stalled_after = STALLED_AFTER
        self.founder = Participant("main", Priority.CLIENT)
        self.running: Participant | None = self.founder
        self.known: set[Participant] = {self.founder}
        self._now = 0.0
        self._sequence = 0
        self._turns = 0  # how often the baton was handed on
        self._ready: list[tuple[int, int, Participant]] = []
        self._timers: list[tuple[float, int, int, int, Participant]] = []
        self._local = threading.local()
        self._local.participant = self.founder
        self._outside = 0
        self.schedule = schedule
        self._external = external

    # ----------------------------------------------------------------------------------- time and waiting
    def now(self) -> float:
        """Virtual seconds since the clock was made."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Wait for ``seconds`` of virtual time; zero or less lets the others of this instant run first."""
        self.sleep_until(self._after(seconds))

    def sleep_until(self, stamp: float) -> None:
        """Wait until virtual time ``stamp``."""
        me = self.current()
        self._forbid_waiting_with_lock(me, 0)
        with self.mutex:
            me.notified = False
            self._add_timer(me, max(stamp, self._now))
            self._release_baton(me)
        self._await_baton(me)

    def settle(self) -> None:
        """Let all that is ready at this instant run, if it is this thread's turn; moves no time."""
        me = self.current()
        if self.running is me and not me.held_locks:
            self.sleep(0.0)

    def wait(self, me: Participant, lock: threading.Lock, waiters: list[Participant], timeout: float | None) -> bool:
        """Give ``lock`` back, wait among ``waiters``, take it again; False after ``timeout`` [s] of virtual time."""
        self._forbid_waiting_with_lock(me, 1)
        with self.mutex:
            me.notified = False
            me.waiting_among = waiters
            waiters.append(me)
            if timeout is not None and timeout < math.inf:
                self._add_timer(me, self._after(timeout))
            else:
                me.ticket += 1
            me.held_locks -= 1
            lock.release()
            self._release_baton(me)
        try:
            self._await_baton(me)
        finally:
            lock.acquire()
            me.held_locks += 1
        return me.notified

    def notify(self, waiters: list[Participant]) -> None:
        """Make all ``waiters`` ready and empty the list."""
        with self.mutex:
            woken = waiters.copy()
            waiters.clear()
            for waiter in woken:
                waiter.notified = True
                waiter.waiting_among = None
                self.make_ready(waiter)
            if woken and self.running is None:
                self.dispatch()

    def maybe_yield(self, me: Participant) -> None:
        """Explore: let another ready thread run before a lock is taken."""
        if self.schedule is None or me.foreign or me.held_locks:
            return
        with self.mutex:
            if not self._ready or self.schedule.random() < 0.5:
                return
            self.make_ready(me)
            self._release_baton(me)
        self._await_baton(me)

    def _after(self, seconds: float) -> float:
        """Stamp ``seconds`` from now; later than now for any positive number, or who waits again would never end."""
        stamp = self._now + max(0.0, seconds)
        return math.nextafter(self._now, math.inf) if stamp == self._now and seconds > 0.0 else stamp

    # ------------------------------------------------------------------------------------------- threads
    def current(self) -> Participant:
        """Return this thread as a participant; raises ThreadDetached if the hang guard has given up on it."""
        try:
            me: Participant = self._local.participant
        except AttributeError:  # a thread that this clock has not seen yet
            me = Participant(threading.current_thread().name, Priority.CLIENT, foreign=True)
            self._local.participant = me
        if me.detached:
            raise ThreadDetached(me.name)
        return me

    def own(self) -> Participant:
        """Return this thread, which has asked for itself before, as a participant, detached or not."""
        me: Participant = self._local.participant
        return me

    def add(self, who: Participant) -> None:
        """Take a new thread into the lockstep, at the present instant."""
        with self.mutex:
            self.known.add(who)
            self.make_ready(who)
            if self.running is None:
                self.dispatch()

    def enter(self, me: Participant) -> None:
        """Begin the thread of ``me`` and wait for its first turn."""
        self._local.participant = me
        me.run_on_this_thread()
        self._await_baton(me)

    def leave(self, me: Participant) -> None:
        """End the thread of ``me``."""
        with self.mutex:
            self.known.discard(me)
            if self.known <= {self.founder}:
                self.on_founder_alone()
            if self.running is me:
                self.running = None
                self.dispatch()

    def on_founder_alone(self) -> None:
        """Only the thread that made the clock is left; the mutex is held."""

    def go_on_as_foreign(self, me: Participant) -> None:
        """Let the thread of a detached participant tidy up beside the lockstep."""
        if self._local.participant is me:
            self._local.participant = Participant(me.name, me.priority, foreign=True)

    @contextmanager
    def outside(self) -> Iterator[None]:
        """Give up the baton while the body runs; on return wait for a turn.

        Several coroutines of one thread may be inside at once, entered and left in any order: the thread counts as
        foreign until the last of them is back.
        """
        me = self.current()
        self._leave_lockstep(me)
        try:
            yield
        finally:
            self._join_lockstep(me)

    def _leave_lockstep(self, me: Participant) -> None:
        with self.mutex:
            me.outside_depth += 1
            if me.outside_depth > 1 or me not in self.known:
                return
            me.foreign = True
            self._outside += 1
            self.running = None
            self.dispatch()

    def _join_lockstep(self, me: Participant) -> None:
        with self.mutex:
            me.outside_depth -= 1
            if me.outside_depth > 0 or me not in self.known:
                return
            me.foreign = False
            self._outside -= 1
            self.make_ready(me)
            if self.running is None:
                self.dispatch()
        self._await_baton(me)

    # ----------------------------------------------------------------------------------------- the baton
    def make_ready(self, who: Participant) -> None:
        """Let ``who`` run at the present instant; the mutex is held."""
        who.ticket += 1
        self._sequence += 1
        heapq.heappush(self._ready, (who.priority, self._sequence, who))

    def dispatch(self) -> None:
        """Choose who runs next, moving time if none is ready; the mutex is held, no thread runs."""
        while True:
            if not self._ready and not self._advance_time():
                self._report_deadlock()
                if not self._ready:
                    return
            nxt = self._pop_ready()
            if nxt.detached:
                continue
            if not nxt.foreign:
                self.running = nxt
                self._turns += 1
                nxt.baton.release()
                return
            nxt.baton.release()  # a foreign thread runs on beside the lockstep

    def _add_timer(self, me: Participant, stamp: float) -> None:
        me.ticket += 1
        self._sequence += 1
        heapq.heappush(self._timers, (stamp, me.priority, self._sequence, me.ticket, me))

    def _release_baton(self, me: Participant) -> None:
        """Pass the baton on, mutex held; a foreign thread has none but may have to start an idle clock."""
        if not me.foreign:
            self.running = None
            me.stop_counting()
        if self.running is None:
            self.dispatch()

    def _await_baton(self, me: Participant) -> None:
        if me.foreign:
            self._await_beside(me)
        elif me is self.founder:  # mostly the main thread, which alone handles signals
            while not me.baton.acquire(timeout=SIGNAL_PERIOD):
                pass
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
        turns = self._turns
        while not me.baton.acquire(timeout=self.stalled_after):
            with self.mutex:
                holder, stalled = self.running, turns == self._turns
                turns = self._turns
                if holder is None or not stalled or not holder.is_blocked():
                    continue
                if me.baton.acquire(blocking=False):  # handed on in the very last moment
                    return
                me.ticket += 1
                me.leave_waiters()
            raise ClockDeadlock(
                f"thread {me.name!r} waits on the clock for thread {holder.name!r}, which waits for another thread "
                "by other means, so that time stands still; let it do so within `with clock.outside():`"
            )

    def _pop_ready(self) -> Participant:
        if self.schedule is not None and len(self._ready) > 1:
            index = int(self.schedule.integers(len(self._ready)))
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
            if ticket == who.ticket:
                who.leave_waiters()
                self.make_ready(who)
        return True

    def _report_deadlock(self) -> None:
        founder = self.founder
        if self._external or self._outside or founder.waiting_among is None:
            return
        founder.leave_waiters()
        founder.deadlock = True
        self.make_ready(founder)

    def _describe_waiters(self) -> str:
        names = sorted(p.name for p in self.known if p is not self.founder)
        return f"at t={self._now:.3f} s every thread waits for another one: main, {', '.join(names) or 'no other'}"

    def _forbid_waiting_with_lock(self, me: Participant, allowed: int) -> None:
        if me.held_locks > allowed:
            raise RuntimeError(f"thread {me.name!r} waits while it holds {me.held_locks - allowed} more condition(s)")
