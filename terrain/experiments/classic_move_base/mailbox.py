"""What goals report to the thread of the state machine, in the order in which it comes."""

from __future__ import annotations

from collections import deque

from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.time.clock import TIME_RESOLUTION, Clock

Message = tuple[AnyGoalHandle, ExePathFeedback | None]
"""A goal, and its feedback while it is not done."""


class Mailbox:
    """Messages that one thread takes and any thread posts.

    Attributes
    ----------
    closed : str
        Why nothing more is taken; empty while the mailbox is open.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._condition = clock.condition()
        self._messages: deque[Message] = deque()
        self.closed = ""

    def open(self) -> None:
        """Begin anew, without messages."""
        self.closed = ""
        self._messages.clear()

    def close(self, reason: str) -> None:
        """Wake the thread that takes messages; never waits."""
        with self._condition:
            self.closed = reason
            self._condition.notify_all()

    def post(self, handle: AnyGoalHandle) -> None:
        """Add a message of a goal."""
        with self._condition:
            self._messages.append((handle, None if handle.done else handle.feedback))
            self._condition.notify_all()

    def next(self, deadline: float) -> Message | None:
        """Wait for the next message, up to a time [s]; None if there is none, or the mailbox is closed."""
        with self._condition:
            while not self._messages and not self.closed and self._clock.now() < deadline - TIME_RESOLUTION:
                self._condition.wait(deadline - self._clock.now())
            return self._messages.popleft() if self._messages else None
