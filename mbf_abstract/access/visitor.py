"""One connected client of a WebSocket server, and what such a server serves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from mbf_abstract.access.outbox import Frame, Outbox
from mbf_abstract.access.page_access import Role

HangUp = Callable[[str], None]


@dataclass(eq=False)
class Visitor:
    """A client; used on the server's event loop only.

    Attributes
    ----------
    name : str
        For events: its address.
    role : Role, optional
        What it may do; None until it has given the token.
    hang_up : callable
        Ends the connection with a reason.
    outbox : Outbox
        Frames that wait to be sent to it.
    """

    name: str
    role: Role | None
    hang_up: HangUp
    outbox: Outbox = field(default_factory=Outbox)


AnyVisitor = TypeVar("AnyVisitor", bound=Visitor)


class Service(Protocol[AnyVisitor]):
    """What a server serves; its methods are called on the event loop, one after the other, and must not wait."""

    def welcome(self, name: str, role: Role | None, hang_up: HangUp) -> AnyVisitor:
        """Return the visitor for a new connection."""

    def take(self, visitor: AnyVisitor, frame: Frame) -> None:
        """Do what a frame asks for."""

    def forget(self, visitor: AnyVisitor) -> None:
        """End what a visitor who is gone has left."""
