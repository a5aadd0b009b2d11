"""One connected client: what it may do, what it has subscribed to and sent, and the frames that wait for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from mbf_abstract.access.visitor import Visitor
from mbf_ros.rosbridge.protocol import error_frame


class SentGoal(Protocol):
    """A goal that a client has sent, to us or to another client."""

    @property
    def cancel(self) -> Callable[[str], Any]:
        """Ask for its end; takes a reason, and does not wait."""


@dataclass(eq=False)
class Client(Visitor):
    """A client of the server; used on the event loop only.

    Attributes
    ----------
    goals : dict of str to SentGoal
        Its goals that are not over, by the ids it gave them.
    calls : int
        Its services that are being worked on.
    """

    goals: dict[str, SentGoal] = field(default_factory=dict)
    calls: int = 0

    def refuse(self, text: str, operation_id: str | None = None) -> None:
        """Answer that an operation cannot be done."""
        self.outbox.answer(error_frame(text, operation_id))
