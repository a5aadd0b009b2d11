"""User callbacks, away from the robot: one thread, a bounded queue, and a fresh thread when a callback blocks.

When the queue is full the oldest entry is dropped and an event says so. A callback that blocks longer than
``patience`` is left alone with its thread, and the others are served by a new one; after ``max_blocked`` such threads
no more callbacks run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from mbf_abstract.clock import Clock, Priority
from mbf_abstract.events import EventBus, EventKind
from mbf_abstract.execution.supervisor import Supervisor

Callback = Callable[[], None]


class CallbackThread:
    """Runs submitted callbacks in order."""

    def __init__(
        self,
        clock: Clock,
        events: EventBus,
        supervisor: Supervisor,
        patience: float = 5.0,
        max_queue: int = 1000,
        max_blocked: int = 4,
    ) -> None:
        self._clock = clock
        self._events = events
        self._supervisor = supervisor
        self._patience = patience
        self._max_blocked = max_blocked
        self._condition = clock.condition()
        self._queue: deque[Callback] = deque()
        self._max_queue = max_queue
        self._generation = 0
        self._running = False
        self._closed = False
        self._started_at = 0.0

    def submit(self, callback: Callback) -> None:
        """Queue a callback; never waits."""
        with self._condition:
            if self._closed:
                return
            if len(self._queue) >= self._max_queue:
                self._queue.popleft()
                self._events.emit(EventKind.FAULT, "callbacks", message=f"queue of {self._max_queue} full, oldest lost")
            self._queue.append(callback)
            if not self._running:
                self._start_thread()
            self._condition.notify_all()

    def close(self) -> None:
        """Run what is queued, then end."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    def _start_thread(self) -> None:
        self._running = True
        generation = self._generation
        self._clock.spawn(lambda: self._loop(generation), "callbacks", Priority.CALLBACK)

    def _loop(self, generation: int) -> None:
        while True:
            with self._condition:
                while not self._queue and not self._closed and generation == self._generation:
                    self._condition.wait()
                if generation != self._generation or not self._queue:
                    return
                callback = self._queue.popleft()
            watch = self._supervisor.watch(lambda: self._give_up_on(generation), self._patience)
            try:
                with self._clock.guarded("a user callback"):
                    callback()
            except Exception as error:
                self._events.emit(
                    EventKind.FAULT, "callbacks", type=type(error).__name__, message=f"a user callback raised: {error}"
                )
            self._supervisor.stop(watch)

    def _give_up_on(self, generation: int) -> None:
        with self._condition:
            if generation != self._generation:
                return
            self._generation += 1
            self._running = False
            self._events.emit(
                EventKind.FAULT, "callbacks", message=f"a user callback blocked for over {self._patience} s"
            )
            if self._generation <= self._max_blocked and self._queue:
                self._start_thread()
            elif self._generation > self._max_blocked:
                self._closed = True
