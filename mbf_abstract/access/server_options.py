"""Where and for whom a WebSocket server listens."""

from __future__ import annotations

from dataclasses import dataclass, field

from mbf_abstract.access.page_access import PageAccess


@dataclass(frozen=True)
class ServerOptions:
    """Where and for whom the server listens.

    Attributes
    ----------
    access : PageAccess
        Interface and tokens; without a token everybody is let in who can reach a loopback interface.
    port : int
        The first one tried; 0 takes a free one.
    origins : tuple of str
        Origins of web pages that may connect, beside the page that the server has served itself.
    max_message : int
        Longest message of a client [bytes].
    max_clients : int
        With the token, and as many that have not given it yet.
    ports : int
        How many are tried, one after the other.
    """

    access: PageAccess = field(default_factory=PageAccess.open)
    port: int = 0
    origins: tuple[str, ...] = ()
    max_message: int = 10_000_000
    max_clients: int = 50
    ports: int = 1
