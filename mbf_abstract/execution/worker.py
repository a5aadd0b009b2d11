"""The thread of one slot: runs one job at a time and lets at most one wait.

A job that does not end (a hung plugin) is *abandoned*: its thread is left to drain and a fresh one serves the slot,
since Python cannot stop a thread. The fresh thread is made when the next job comes.
"""

from __future__ import annotations

from typing import Protocol

from mbf_abstract.time.clock import Clock, Priority


class Job(Protocol):
    """Something a worker runs. Neither method may raise."""

    def run(self) -> None:
        """Do the work; called on the worker's thread."""

    def preempt(self) -> None:
        """Ask the running work to end because another job waits; must not block."""


class Worker:
    """Runs the jobs of one slot in order on one thread, which is reused."""

    def __init__(self, clock: Clock, name: str) -> None:
        self._clock = clock
        self._name = name
        self._condition = clock.condition()
        self._current: Job | None = None
        self._pending: Job | None = None
        self._generation = 0
        self._thread_generation = -1
        self._closed = False

    @property
    def current(self) -> Job | None:
        """The running job."""
        return self._current

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._current is not None or self._pending is not None

    def submit(self, job: Job) -> Job | None:
        """Queue ``job`` and ask a running one to end; return the job that will never run because of it.

        That is the one that was waiting so far, or ``job`` itself when the worker is closed.
        """
        with self._condition:
            if self._closed:
                return job
            displaced, self._pending = self._pending, job
            running = self._current
            self._ensure_thread()
            self._condition.notify_all()
        if running is not None:
            running.preempt()
        return displaced

    def abandon(self, job: Job) -> None:
        """Give up on ``job`` if it still runs: the slot goes on without its thread."""
        with self._condition:
            if self._current is job:
                self._current = None
                self._generation += 1
                if self._pending is not None:
                    self._ensure_thread()

    def close(self) -> Job | None:
        """Take no more jobs and end the thread once idle; return the job that was still waiting."""
        with self._condition:
            self._closed = True
            waiting, self._pending = self._pending, None
            self._condition.notify_all()
            return waiting

    def _ensure_thread(self) -> None:
        if self._thread_generation != self._generation:
            self._thread_generation = self._generation
            generation = self._generation
            self._clock.spawn(lambda: self._loop(generation), self._name, Priority.WORKER)

    def _loop(self, generation: int) -> None:
        while True:
            with self._condition:
                while self._pending is None and not self._closed and generation == self._generation:
                    self._condition.wait()
                if generation != self._generation or self._pending is None:
                    return
                job, self._pending = self._pending, None
                self._current = job
            job.run()
            with self._condition:
                if generation != self._generation:
                    return
                self._current = None
