"""How a run is shown while it goes on."""

from __future__ import annotations

from dataclasses import dataclass

from terrain.viewer.server.page_access import LOOPBACK, PageAccess, is_loopback


@dataclass(frozen=True)
class ViewOptions:
    """Where the page is served and how time passes.

    Attributes
    ----------
    host : str
        Interface to listen at.
    port : int
        The first one tried; the next free one is taken.
    speed : float
        Simulated seconds per second at most; 0 = as fast as possible.
    token : bool
        Put a token into the address, so that only those who know it have access; without it, all who can reach it have.
    read_only : bool
        Watching only; else there are two addresses, one to steer and one to watch.

    Raises
    ------
    ValueError
        A negative speed, or no token on an interface that other machines can reach.
    """

    host: str = LOOPBACK
    port: int = 8080
    speed: float = 1.0
    token: bool = True
    read_only: bool = False

    def __post_init__(self) -> None:
        if self.speed < 0.0:
            raise ValueError(f"speed must not be negative, got {self.speed}")
        if not self.token and not is_loopback(self.host):
            raise ValueError(f"without a token a page is served at loopback only, not at {self.host!r}")

    def access(self) -> PageAccess:
        """Decide who gets in, with new tokens each time."""
        make = PageAccess.by_token if self.token else PageAccess.open
        return make(self.host, self.read_only)
