"""The line that lives in the terminal while a run goes on; plain lines, and few of them, where there is no terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.console import Console
from rich.status import Status

if TYPE_CHECKING:
    from terrain.runner import Progress


class LiveLine:
    """Shows preparation steps and driving progress on stderr, so that stdout keeps the results.

    Parameters
    ----------
    show : bool
        False shows nothing at all.
    console : rich.console.Console, optional
        Another place than stderr, for tests.
    """

    def __init__(self, show: bool = True, console: Console | None = None) -> None:
        self._show = show
        self._console = console or Console(stderr=True, highlight=False)
        self._status: Status | None = None

    def __enter__(self) -> LiveLine:
        if self._show and self._console.is_terminal:
            self._status = self._console.status("starting", spinner="dots")
            self._status.start()
        return self

    def __exit__(self, *exc: object) -> None:
        if self._status is not None:
            self._status.stop()

    def step(self, text: str) -> None:
        """Tell of a preparation that may take a while."""
        if self._status is not None:
            self._status.update(text)
        elif self._show:
            self._console.print(text)

    def note(self, text: str) -> None:
        """Leave a line in the terminal that stays, also where nothing else is shown."""
        self._console.print(text)

    def progress(self, progress: Progress) -> None:
        """Tell how the drive goes; without a terminal this is left out."""
        if self._status is not None:
            self._status.update(progress_text(progress))


def progress_text(progress: Progress) -> str:
    """One line: time and its factor, action state, distance left, speed, tilt."""
    factor = progress.time / progress.wall_time if progress.wall_time > 0.0 else 0.0
    left = "  --  m" if math.isnan(progress.distance_left) else f"{progress.distance_left:6.1f} m"
    return (
        f"{progress.time:6.1f} s ({factor:4.1f} x)  {progress.state:10}  {left} left  "
        f"{progress.speed:5.2f} m/s  tilt {math.degrees(progress.tilt):4.1f}°"
    )
