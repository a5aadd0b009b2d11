"""A spinner on stderr for what may take over a second; nothing where stderr is no terminal, so that logs stay short."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


@contextmanager
def waiting(text: str, console: Console | None = None) -> Iterator[Callable[[str], None]]:
    """Show ``text``, and for how long it has been so, while the block runs; yields a function that changes the text."""
    if console is None and not sys.stderr.isatty():
        yield lambda news: None  # rich takes 0.1 s to import
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    screen = console or Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as progress:
        task = progress.add_task(text)
        yield lambda news: progress.update(task, description=news)
