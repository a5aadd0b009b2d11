"""What all actions share: slots, acceptance, preemption, and exactly one final state for every goal.

The flow of a goal: ``send`` checks it and either rejects it with the reason or queues it for its slot; the slot's
worker runs ``execute``, whose result becomes the goal's final state. A new goal in a used slot takes over the running
one where that is open to it (``exe_path``, ``move_base``): the robot drives on. Else it asks the running one to end and
waits its turn. Only the newest waits, the one it displaces ends CANCELED. Nothing here ever joins a thread.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Generic, TypeVar

from mbf_abstract.event_values import error_text
from mbf_abstract.events import EventKind
from mbf_abstract.execution.loaded_plugin import PluginGone
from mbf_abstract.execution.plugin_run import Abandoned
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.execution.worker import Worker
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.handle import GoalHandle
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.outcomes import is_success
from mbf_abstract.time.clock import ThreadDetached

G = TypeVar("G")
R = TypeVar("R", bound=ActionResult)
F = TypeVar("F")

PREEMPTED = "preempted by a new goal"
SHUT_DOWN = "the server is shut down"


def _nothing() -> None:
    """Do nothing, for a job that need not know that it has an offer."""


class GoalJob(Generic[G, R, F]):
    """A goal as its slot's worker runs it; while it runs, a newer goal of the slot may take it over."""

    def __init__(self, action: Action[G, R, F], handle: GoalHandle[G, R, F], slot: int) -> None:
        self.action = action
        self.handle = handle
        self.slot = slot
        self._condition = action._condition
        self._accepts: Callable[[G], bool] | None = None
        self._on_offer: Callable[[], None] = _nothing
        self._offered: GoalJob[G, R, F] | None = None

    # ------------------------------------------------------------------------------ for the slot's worker
    def run(self) -> None:
        """Execute the goal unless it was canceled while it waited; always leaves it in a final state."""
        action = self.action
        if self.handle.cancel_requested:
            self._end_unstarted(self.handle.cancel_reason)
            return
        self.handle.activate()
        try:
            result = action.execute(self)
            action.finish_with(self.handle, result)
        except Abandoned:
            pass  # the goal has ended without this thread
        except PluginGone as error:
            action.finish(self.handle, action.invalid_plugin_outcome, str(error))
        except ThreadDetached:
            raise  # the clock has given up on this thread
        except BaseException as error:  # e.g. of a driver; the slot must live on
            text = error_text(error)
            action.runtime.events.emit(
                EventKind.FAULT, action.name, goal_id=self.handle.id, type=type(error).__name__, message=text
            )
            text = f"{type(error).__name__} in the framework: {text}"
            action.finish(self.handle, action.internal_error_outcome, text)

    def preempt(self) -> None:
        """Cancel the goal because a newer one waits."""
        self.handle.cancel(PREEMPTED)

    def _end_unstarted(self, reason: str) -> None:
        self.action.finish(self.handle, self.action.canceled_outcome, f"{reason} before it started")

    # ------------------------------------------------------------------------------- for the action
    def report_started(self, **data: object) -> None:
        """Record that the goal is being worked on."""
        self.action.runtime.events.emit(
            EventKind.GOAL_STARTED, self.action.name, goal_id=self.handle.id, slot=self.slot, **data
        )

    def abandon(self, outcome: int, message: str) -> None:
        """End the goal while its plugin hangs, and free the slot."""
        self.action.finish(self.handle, outcome, message)
        self.action.worker(self.slot).abandon(self)

    # ---------------------------------------------------------------------- take-over by a newer goal
    @contextmanager
    def open_to_take_over(
        self, accepts: Callable[[G], bool], on_offer: Callable[[], None] = _nothing
    ) -> Iterator[None]:
        """Let newer goals of the slot take this job over while the body runs, without an end in between.

        Parameters
        ----------
        accepts : callable
            Whether the running work can go on with that goal; others are queued.
        on_offer : callable
            Called, on the sender's thread, when there is something for ``take_over``; must be short.
        """
        with self._condition:
            self._accepts, self._on_offer = accepts, on_offer
        try:
            yield
        finally:
            self.end_take_over()

    def offer(self, newer: GoalJob[G, R, F]) -> bool:
        """Offer a newer goal; False if it must be queued. An older offer ends CANCELED."""
        with self._condition:
            if self._accepts is None or self.handle.cancel_requested or not self._accepts(newer.handle.goal):
                return False
            displaced, self._offered = self._offered, newer
        self._on_offer()
        if displaced is not None:
            displaced._end_unstarted(PREEMPTED)
        return True

    @property
    def offered(self) -> bool:
        """Whether a newer goal waits for ``take_over``."""
        return self._offered is not None

    def take_over(self, adopt: Callable[[GoalHandle[G, R, F]], None], reason: str, **data: object) -> bool:
        """Go on with the newest goal on offer; the old one ends CANCELED. False if there is none.

        Parameters
        ----------
        adopt : callable
            Makes the running work serve the new handle, before the old goal ends.
        reason : str
            Message of the old goal's result.
        **data
            For the event that the new goal has started.
        """
        with self._condition:
            newer, self._offered = self._offered, None
        if newer is None:
            return False
        old, self.handle = self.handle, newer.handle
        newer.handle.activate()
        adopt(newer.handle)
        self.action.finish(old, self.action.canceled_outcome, reason)
        self.report_started(**data)
        return True

    def end_take_over(self) -> None:
        """Refuse further offers, and queue one that came too late: it must not be lost. Idempotent."""
        with self._condition:
            self._accepts = None
            late, self._offered = self._offered, None
        if late is not None:
            self.action.queue(late)


class Action(ABC, Generic[G, R, F]):
    """One action of a server: accepts goals and runs them in slots."""

    name: ClassVar[str]
    canceled_outcome: ClassVar[int]
    invalid_plugin_outcome: ClassVar[int]
    internal_error_outcome: ClassVar[int]

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self._workers: dict[int, Worker] = {}
        self._condition = runtime.clock.condition()
        self._unfinished: dict[int, GoalHandle[G, R, F]] = {}
        self._closed = False
        self.listeners: list[Callable[[GoalHandle[G, R, F]], None]] = []
        """Called with every goal that has ended, on the thread that ended it: must be short and must not raise."""
        self.accept_listeners: list[Callable[[GoalHandle[G, R, F]], None]] = []
        """Called with every goal that is accepted, before it begins, on the sender's thread; as ``listeners``."""

    # ------------------------------------------------------------------------------------------ client
    def send(self, goal: G, on_done: Callable[[GoalHandle[G, R, F]], None] | None = None) -> GoalHandle[G, R, F]:
        """Send a goal; returns at once, also when the goal is rejected."""
        handle: GoalHandle[G, R, F] = GoalHandle(next(self.runtime.goal_ids), self.name, goal, self.runtime)
        if on_done is not None:
            handle.add_done_callback(on_done)
        rejection = self.rejection(goal)
        if rejection is not None:
            outcome, message = rejection
            self.runtime.events.emit(EventKind.GOAL_REJECTED, self.name, goal_id=handle.id, message=message)
            handle.finish(GoalStatus.REJECTED, self.make_result(handle, outcome, message))
            return handle
        slot = self._slot(goal)
        self.runtime.events.emit(
            EventKind.GOAL_ACCEPTED, self.name, goal_id=handle.id, slot=slot, **self._goal_data(goal)
        )
        with self._condition:
            self._unfinished[handle.id] = handle
        for listener in self.accept_listeners:
            listener(handle)
        self._dispatch(GoalJob(self, handle, slot))
        return handle

    def cancel_all(self, reason: str = "all goals canceled") -> None:
        """Cancel every goal that is not final; never waits."""
        for handle in self.unfinished:
            handle.cancel(reason)

    def close(self) -> None:
        """Cancel everything and take no more goals."""
        with self._condition:
            self._closed = True
            workers = list(self._workers.values())
        self.cancel_all(SHUT_DOWN)
        for worker in workers:
            waiting = worker.close()
            if isinstance(waiting, GoalJob):
                waiting._end_unstarted(SHUT_DOWN)

    @property
    def unfinished(self) -> list[GoalHandle[G, R, F]]:
        """Goals that are not final, oldest first."""
        with self._condition:
            return list(self._unfinished.values())

    @property
    def busy(self) -> bool:
        """Whether any goal is not final."""
        return bool(self._unfinished)

    # ------------------------------------------------------------------------------- for derived actions
    @abstractmethod
    def _check(self, goal: G) -> tuple[int, str] | None:
        """Reason to reject the goal: (outcome, message), or None to accept it."""

    @abstractmethod
    def execute(self, job: GoalJob[G, R, F]) -> R:
        """Run the goal on the worker's thread and return its result."""

    @abstractmethod
    def make_result(self, handle: GoalHandle[G, R, F], outcome: int, message: str) -> R:
        """Build a result without path or pose, for ends that have none."""

    @abstractmethod
    def _goal_data(self, goal: G) -> dict[str, Any]:
        """Data of an accepted goal for the event log."""

    def _slot(self, goal: G) -> int:
        return int(getattr(goal, "concurrency_slot", 0))

    def _dispatch(self, job: GoalJob[G, R, F]) -> None:
        """Hand the job to the running one of its slot, if that can take its goal over, else queue it."""
        running = self.worker(job.slot).current
        if not (isinstance(running, GoalJob) and running.offer(job)):
            self.queue(job)

    def queue(self, job: GoalJob[G, R, F]) -> None:
        """Let a job wait for the end of the running one of its slot, which is asked to end."""
        displaced = self.worker(job.slot).submit(job)
        if isinstance(displaced, GoalJob):
            displaced._end_unstarted(SHUT_DOWN if displaced is job else PREEMPTED)

    def worker(self, slot: int) -> Worker:
        """Worker of a slot, made at its first use."""
        with self._condition:
            if slot not in self._workers:
                self._workers[slot] = Worker(self.runtime.clock, f"{self.name} slot {slot}")
                if self._closed:
                    self._workers[slot].close()
            return self._workers[slot]

    def finish(self, handle: GoalHandle[G, R, F], outcome: int, message: str) -> None:
        """End a goal with an outcome and a text only."""
        self.finish_with(handle, self.make_result(handle, outcome, message))

    def finish_with(self, handle: GoalHandle[G, R, F], result: R) -> None:
        """Set the goal's final state from its result."""
        if is_success(result.outcome):
            status = GoalStatus.SUCCEEDED
        elif self._is_cancel(handle, result.outcome):
            status = GoalStatus.CANCELED
        else:
            status = GoalStatus.ABORTED
        handle.finish(status, result)
        with self._condition:
            self._unfinished.pop(handle.id, None)
        for listener in self.listeners:
            listener(handle)

    def _is_cancel(self, handle: GoalHandle[G, R, F], outcome: int) -> bool:
        return outcome == self.canceled_outcome

    def rejection(self, goal: G) -> tuple[int, str] | None:
        """Why the goal would be rejected if it came now, as outcome and text; None if it would not."""
        if self._closed:
            return self.internal_error_outcome, SHUT_DOWN
        slot = self._slot(goal)
        if not 0 <= slot <= 255:
            return self.internal_error_outcome, f"concurrency_slot must be 0..255, got {slot}"
        limit = self.runtime.parameters.max_quarantined
        if len(self.runtime.hanging) >= limit:
            return self.internal_error_outcome, f"{limit} plugin calls hang; no more goals until one returns"
        return self._check(goal)
