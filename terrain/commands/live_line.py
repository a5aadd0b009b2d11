"""The status line in the terminal during a run: the present step, a bar, and the time.

Where there is no terminal, and with ``mbf run --json`` and ``--quiet``, only notes are printed.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from terrain.session.runner import Progress as RunProgress

COUNTED = re.compile(r"\((\d+) of (\d+)\)$")


class LiveLine:
    """Shows preparation steps and driving progress on stderr, so that stdout keeps the results.

    Parameters
    ----------
    show : bool
        False shows notes only.
    console : rich.console.Console, optional
        Another place than stderr, for tests.
    """

    def __init__(self, show: bool = True, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True, highlight=False)
        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(20), TimeElapsedColumn())
        hidden = not (show and self._console.is_terminal)
        self._bar = Progress(*columns, console=self._console, transient=True, disable=hidden)
        self._task = self._bar.add_task("starting", total=None)
        self._longest: float | None = None

    def __enter__(self) -> LiveLine:
        self._bar.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._bar.stop()

    def step(self, text: str) -> None:
        """Show a preparation that may take a while; a text that ends in ``(2 of 5)`` fills the bar so far."""
        counted = COUNTED.search(text)
        done, total = map(int, counted.groups()) if counted else (0, None)
        self._bar.remove_task(self._task)
        self._task = self._bar.add_task(text, completed=done, total=total)

    def note(self, text: str) -> None:
        """Leave a line in the terminal that stays, also where nothing else is shown."""
        self._console.print(text, markup=False, soft_wrap=True)

    def progress(self, progress: RunProgress) -> None:
        """Show the progress of the drive; the bar is the share of the longest distance to the goal."""
        left = progress.distance_left
        if math.isfinite(left):
            self._longest = max(left, self._longest or 0.0)
        done = self._longest - left if self._longest is not None and math.isfinite(left) else None
        self._bar.update(self._task, description=progress_text(progress), completed=done, total=self._longest)


def progress_text(progress: RunProgress) -> str:
    """One line: time and its factor, action state, distance left, speed, tilt."""
    factor = progress.time / progress.wall_time if progress.wall_time > 0.0 else 0.0
    left = "  --  m" if math.isnan(progress.distance_left) else f"{progress.distance_left:6.1f} m"
    return (
        f"{progress.time:6.1f} s ({factor:4.1f} x)  {progress.state:10}  {left} left  "
        f"{progress.speed:5.2f} m/s  tilt {math.degrees(progress.tilt):4.1f}°"
    )
