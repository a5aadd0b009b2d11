"""How a run is shown while it goes on; light to import, because a runner needs it for runs without a page, too."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ViewOptions:
    """Where the page is served and how time passes.

    Attributes
    ----------
    host : str
        Interface to listen at. Whoever can reach it can drive the robot, so it is loopback unless told otherwise.
    port : int
        The first one tried; the next free one is taken.
    speed : float
        Simulated seconds per second at most; 0 = as fast as possible.
    stay : bool
        Wait for further goals after those of the scenario, until Ctrl-C.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    speed: float = 1.0
    stay: bool = True

    def __post_init__(self) -> None:
        if self.speed < 0.0:
            raise ValueError(f"speed must not be negative, got {self.speed}")
