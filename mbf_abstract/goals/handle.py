"""The client's end of one goal: status, result, feedback, cancel, pause. Every goal has a handle of its own.

A handle works in three styles: block (``wait``), poll (``status``, ``feedback``) or ``await``. Callbacks run on the
server's callback thread, so one that raises or is slow harms neither the robot nor the sender.

An asyncio task that is canceled, or times out, while it awaits a handle cancels the goal, and the robot stops. To
give up waiting only, shield the handle:
``await asyncio.wait_for(asyncio.shield(handle), 5.0)``.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Generator
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar

from mbf_abstract.events import EventKind
from mbf_abstract.goals.awaiting import awaited
from mbf_abstract.goals.goal_status import GoalStatus
from mbf_abstract.goals.result_types import ActionResult
from mbf_abstract.time.cancel import CancelToken

if TYPE_CHECKING:
    from mbf_abstract.execution.runtime import Runtime

G = TypeVar("G")
R = TypeVar("R", bound=ActionResult)
F = TypeVar("F")


class GoalHandle(Generic[G, R, F]):
    """One goal on its way through the server. Thread-safe; made by ``Action.send`` only.

    Attributes
    ----------
    id : int
        Unique in the server; every event and callback carries it.
    goal : object
        The goal as sent.
    cancel_token : CancelToken
        What the plugin polls. Set by ``cancel`` and, with another reason, when patience runs out.
    cancel_requested, cancel_reason : bool, str
        Whether a client, or a newer goal, has asked this goal to end, and why.
    """

    def __init__(self, goal_id: int, action: str, goal: G, runtime: Runtime) -> None:
        self.id = goal_id
        self.action = action
        self.goal = goal
        self.cancel_token = CancelToken()
        self.cancel_requested = False
        self.cancel_reason = ""
        self._runtime = runtime
        self._condition = runtime.clock.condition()
        self._status = GoalStatus.PENDING
        self._result: R | None = None
        self._feedback: F | None = None
        self._paused = False
        self._done_callbacks: list[Callable[[GoalHandle[G, R, F]], None]] = []
        self._feedback_callbacks: dict[object, Callable[[F], None]] = {}
        self._wake_callbacks: list[Callable[[], None]] = []
        self._subscribers: list[Callable[[GoalHandle[G, R, F]], None]] = []

    # ------------------------------------------------------------------------------------------ client
    @property
    def status(self) -> GoalStatus:
        """Present status."""
        return self._status

    @property
    def done(self) -> bool:
        """Whether the goal has reached its final status."""
        return self._status.is_final

    @property
    def result(self) -> R | None:
        """The result, None until the goal is done."""
        return self._result

    @property
    def feedback(self) -> F | None:
        """The newest feedback, None before the first."""
        return self._feedback

    @property
    def paused(self) -> bool:
        """Whether the client has paused the goal."""
        return self._paused

    def wait(self, timeout: float | None = None) -> R:
        """Wait for the result.

        Parameters
        ----------
        timeout : float, optional
            Longest wait [s]; None or infinity = until the goal is done.

        Raises
        ------
        TimeoutError
            The time has passed; the goal goes on.
        ValueError
            The timeout is not a number.
        """
        if timeout is not None and math.isnan(timeout):
            raise ValueError("the timeout is not a number")
        clock = self._runtime.clock
        deadline = None if timeout is None or timeout > threading.TIMEOUT_MAX else clock.now() + timeout
        with self._condition:
            while self._result is None:
                remaining = None if deadline is None else deadline - clock.now()
                if remaining is not None and remaining <= 0.0:
                    raise TimeoutError(f"{self.action} goal {self.id} is still {self._status.value} after {timeout} s")
                self._condition.wait(remaining)
            return self._result

    def __await__(self) -> Generator[Any, None, R]:
        return awaited(self, self._runtime.clock).__await__()

    def cancel(self, reason: str = "canceled by the client") -> None:
        """Ask the goal to end; idempotent, without effect on a finished goal. Never waits."""
        with self._condition:
            if self.done or self.cancel_requested:
                return
            self.cancel_requested = True
            self.cancel_reason = reason
            if self._status is not GoalStatus.PENDING:
                self._status = GoalStatus.CANCELING
        self._runtime.events.emit(EventKind.GOAL_CANCEL, self.action, goal_id=self.id, reason=reason)
        self.cancel_token.cancel(reason)
        self._wake()

    def pause(self) -> None:
        """Hold: the robot stands, goal and slot are kept, patience stops; idempotent."""
        self._set_paused(True)

    def resume(self) -> None:
        """Go on after ``pause``; idempotent."""
        self._set_paused(False)

    def add_done_callback(self, callback: Callable[[GoalHandle[G, R, F]], None]) -> None:
        """Call ``callback(handle)`` once when the goal is done, also if it already is; it is never left out."""
        with self._condition:
            if self.done:
                self._runtime.callbacks.submit(lambda: callback(self))
            else:
                self._done_callbacks.append(callback)

    def add_feedback_callback(self, callback: Callable[[F], None]) -> None:
        """Call ``callback(feedback)`` for every feedback from now on; a slow one gets the newest and misses others."""
        with self._condition:
            self._feedback_callbacks[object()] = callback

    # ------------------------------------------------------------------------------------------ server
    def on_wake(self, callback: Callable[[], None]) -> None:
        """Run ``callback`` (server side, short) whenever the goal is canceled, paused or resumed."""
        self._wake_callbacks.append(callback)

    def subscribe(self, callback: Callable[[GoalHandle[G, R, F]], None]) -> None:
        """Run ``callback`` (server side, short) on every feedback and on the final state, at once if there."""
        with self._condition:
            if not self.done:
                self._subscribers.append(callback)
                return
        callback(self)

    def activate(self) -> None:
        """PENDING -> ACTIVE (or CANCELING if the cancel was faster)."""
        with self._condition:
            if self._status is GoalStatus.PENDING:
                self._status = self._running_status()

    def publish_feedback(self, feedback: F) -> None:
        """Make ``feedback`` the newest and hand it to the callbacks; dropped once the goal is done."""
        with self._condition:
            if self.done:
                return
            self._feedback = feedback
            for taker, callback in self._feedback_callbacks.items():
                self._runtime.callbacks.submit(partial(callback, feedback), newest_of=taker)
            subscribers = list(self._subscribers)
        for subscriber in subscribers:
            subscriber(self)

    def finish(self, status: GoalStatus, result: R) -> bool:
        """Set the final status and the result; False if the goal already was final (then nothing changes)."""
        with self._condition:
            if self.done:
                return False
            self._runtime.events.emit(
                EventKind.GOAL_FINISHED,
                self.action,
                goal_id=self.id,
                status=status.value,
                outcome=result.outcome,
                outcome_name=result.outcome_name,
                message=result.message,
            )
            self._status = status
            self._result = result
            for callback in self._done_callbacks:  # queued with the lock held, so after all feedback
                self._runtime.callbacks.submit(partial(callback, self))
            self._done_callbacks.clear()
            subscribers, self._subscribers = self._subscribers, []
            self._feedback_callbacks.clear()
            self._wake_callbacks.clear()
            self._condition.notify_all()
        for subscriber in subscribers:
            subscriber(self)
        return True

    def _set_paused(self, paused: bool) -> None:
        with self._condition:
            if self.done or self._paused == paused:
                return
            self._paused = paused
            if self._status in (GoalStatus.ACTIVE, GoalStatus.PAUSED):
                self._status = self._running_status()
        kind = EventKind.GOAL_PAUSED if paused else EventKind.GOAL_RESUMED
        self._runtime.events.emit(kind, self.action, goal_id=self.id)
        self._wake()

    def _running_status(self) -> GoalStatus:
        if self.cancel_requested:
            return GoalStatus.CANCELING
        return GoalStatus.PAUSED if self._paused else GoalStatus.ACTIVE

    def _wake(self) -> None:
        for callback in list(self._wake_callbacks):
            callback()

    def __repr__(self) -> str:
        tail = f": {self._result.outcome_name}" if self._result else ""
        return f"<{self.action} goal {self.id}, {self._status.value}{tail}>"


AnyGoalHandle: TypeAlias = GoalHandle[Any, Any, Any]
