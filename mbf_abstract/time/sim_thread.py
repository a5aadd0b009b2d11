"""Conditions and threads in lockstep; they know the scheduler only. ``SimClock`` makes them."""

from __future__ import annotations

import threading
from collections.abc import Callable

from mbf_abstract.time.clock import ThreadDetached
from mbf_abstract.time.participant import Participant
from mbf_abstract.time.scheduler import LockstepScheduler


class SimCondition:
    """A condition in virtual time; the real lock inside is contended only by foreign threads."""

    __slots__ = ("_lock", "_scheduler", "waiters")

    def __init__(self, scheduler: LockstepScheduler) -> None:
        self._scheduler = scheduler
        self._lock = threading.Lock()
        self.waiters: list[Participant] = []

    def __enter__(self) -> SimCondition:
        scheduler = self._scheduler
        me = scheduler.current()
        if scheduler.schedule is not None:
            scheduler.maybe_yield(me)
        self._lock.acquire()
        me.held_locks += 1
        return self

    def __exit__(self, *exc: object) -> None:
        self._scheduler.own().held_locks -= 1
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait in virtual time; False after ``timeout`` [s] of it."""
        return self._scheduler.wait(self._scheduler.current(), self._lock, self.waiters, timeout)

    def notify_all(self) -> None:
        """Make all waiters ready."""
        self._scheduler.notify(self.waiters)


class SimThread:
    """A thread in lockstep."""

    def __init__(self, scheduler: LockstepScheduler, target: Callable[[], None], name: str, priority: int) -> None:
        self._scheduler = scheduler
        self._ended = SimCondition(scheduler)
        self._alive = True
        self._me = Participant(name, priority)
        self._target = target
        thread = threading.Thread(target=self._run, name=name, daemon=True)
        thread.start()  # before it is known: the lockstep would wait for one that a Ctrl-C keeps from starting
        scheduler.add(self._me)

    @property
    def name(self) -> str:
        """Name of the thread."""
        return self._me.name

    def is_alive(self) -> bool:
        """Whether its body has not ended."""
        return self._alive

    def join(self, timeout: float | None = None) -> bool:
        """Wait for its end, at most ``timeout`` [s] of virtual time; return whether it has come."""
        deadline = None if timeout is None else self._scheduler.now() + timeout
        with self._ended:
            while self._alive:
                remaining = None if deadline is None else deadline - self._scheduler.now()
                if remaining is not None and remaining <= 0.0:
                    break
                self._ended.wait(remaining)
        return not self._alive

    def _run(self) -> None:
        scheduler = self._scheduler
        try:
            scheduler.enter(self._me)
            self._target()
        except ThreadDetached:
            pass
        finally:
            if self._me.detached:
                scheduler.go_on_as_foreign(self._me)
            with self._ended:
                self._alive = False
                self._ended.notify_all()
            scheduler.leave(self._me)
