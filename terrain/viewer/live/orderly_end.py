"""Ctrl-C while a run is watched: it ends in order, so that its results are written."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def orderly_ctrl_c(end: Callable[[], None]) -> Iterator[None]:
    """Let Ctrl-C end the run in order, so that its results are written; a second one breaks it off."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = _OrderlyEnd(end)
    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler.before)


class _OrderlyEnd:
    """Handles one Ctrl-C by ending a run, and those of the other robots of a scenario that are watched, too."""

    def __init__(self, end: Callable[[], None]) -> None:
        self.before = signal.getsignal(signal.SIGINT)
        self._end = end

    def __call__(self, number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, self.before)
        self._end()
        if isinstance(self.before, _OrderlyEnd):
            self.before(number, frame)
