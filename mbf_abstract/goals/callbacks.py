"""User callbacks, away from the robot: one thread that runs them in order, and a fresh one when a callback blocks.

The end of a goal is never lost: what is submitted runs, also after ``close``, once each and in the order of
submission. Feedback is: of several that one callback has not taken yet only the newest stays, so a slow callback can
not fill the queue. A callback that blocks longer than ``patience`` keeps its thread to itself, gets no
feedback until it returns, and the others are served by a new thread. With more than ``max_blocked`` such threads the
queue waits until one of them comes back.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.supervisor import Supervisor
from mbf_abstract.time.clock import Clock, Priority

Callback = Callable[[], None]

Call = tuple[Hashable, Callback]
"""Who takes it, and what is called."""


class CallbackThread:
    """Runs submitted callbacks in order."""

    def __init__(
        self, clock: Clock, events: EventBus, supervisor: Supervisor, patience: float = 5.0, max_blocked: int = 4
    ) -> None:
        self._clock = clock
        self._events = events
        self._supervisor = supervisor
        self._patience = patience
        self._max_blocked = max_blocked
        self._condition = clock.condition()
        self._queue: OrderedDict[Hashable, Callback] = OrderedDict()
        self._blocked: set[Hashable] = set()
        self._running: Call | None = None
        self._serving = False
        self._closed = False

    def submit(self, callback: Callback, newest_of: Hashable | None = None) -> None:
        """Queue a callback; never waits.

        Parameters
        ----------
        newest_of : hashable, optional
            Who takes it, where only the newest matters: it replaces one of the same taker that is still queued, in
            its place, and is dropped while the taker is blocked.
        """
        taker = object() if newest_of is None else newest_of
        with self._condition:
            if taker in self._blocked:
                return
            self._queue[taker] = callback
            self._serve()
            self._condition.notify_all()

    def close(self) -> None:
        """End the thread once the queue is empty; what comes later is still run, by a thread of its own."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    def _serve(self) -> None:
        """Make sure that a thread serves the queue; the caller holds the condition."""
        if self._queue and not self._serving and len(self._blocked) <= self._max_blocked:
            self._serving = True
            self._clock.spawn(self._loop, "callbacks", Priority.CALLBACK)

    def _loop(self) -> None:
        while True:
            with self._condition:
                while not self._queue and not self._closed:
                    self._condition.wait()
                if not self._queue:
                    self._serving = False
                    return
                self._running = call = self._queue.popitem(last=False)
            self._run(call)
            with self._condition:
                if self._running is not call:  # another thread serves the queue
                    self._blocked.discard(call[0])
                    self._serve()
                    return
                self._running = None

    def _run(self, call: Call) -> None:
        """Run one callback; only its own thread may be lost with it."""
        watch = self._supervisor.watch(lambda: self._give_up_on(call), self._patience)
        try:
            with self._clock.guarded("a user callback"):
                call[1]()
        except BaseException as error:
            text = f"a user callback raised: {error_text(error)}"
            self._events.emit(EventKind.FAULT, "callbacks", type=type(error).__name__, message=text)
        self._supervisor.stop(watch)

    def _give_up_on(self, call: Call) -> None:
        with self._condition:
            if self._running is not call:
                return
            self._running = None
            self._serving = False
            self._blocked.add(call[0])
            self._queue.pop(call[0], None)
            self._serve()
        text = f"a user callback blocked for over {self._patience} s"
        self._events.emit(EventKind.FAULT, "callbacks", message=text)
