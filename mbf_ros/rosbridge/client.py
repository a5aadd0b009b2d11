"""One connected client: what it may do, what it has subscribed to and sent, and the frames that wait for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from mbf_abstract.access.page_access import Role
from mbf_ros.rosbridge.outbox import Outbox
from mbf_ros.rosbridge.protocol import error_frame


class SentGoal(Protocol):
    """A goal that a client has sent, to us or to another client."""

    @property
    def cancel(self) -> Callable[[str], Any]:
        """Ask for its end; takes a reason, and does not wait."""


@dataclass(eq=False)
class Client:
    """A client of the server; used on the event loop only.

    Attributes
    ----------
    name : str
        For events: its address.
    role : Role, optional
        What it may do; None until it has given the token.
    outbox : Outbox
    goals : dict of str to SentGoal
        Its goals that are not over, by the ids it gave them.
    calls : int
        Its services that are being worked on.
    hang_up : callable
        Ends the connection with a reason.
    """

    name: str
    role: Role | None
    hang_up: Callable[[str], None]
    outbox: Outbox = field(default_factory=Outbox)
    goals: dict[str, SentGoal] = field(default_factory=dict)
    calls: int = 0

    def refuse(self, text: str, operation_id: str | None = None) -> None:
        """Answer that an operation cannot be done."""
        self.outbox.answer(error_frame(text, operation_id))
