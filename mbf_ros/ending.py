"""How commands that run for as long as they are wanted come to their end."""

from __future__ import annotations

import re
import signal
import threading
from collections.abc import Callable

SECONDS = re.compile(r"-?[\d.]+ s\b")


def wait_for_ctrl_c(look: Callable[[], None] = lambda: None, period: float = 1.0) -> None:
    """Wait for Ctrl-C, and call ``look`` every ``period`` [s] until then.

    SIGTERM ends the program by an exception, see ``server.process_end``.
    """
    pressed = threading.Event()
    before = signal.signal(signal.SIGINT, lambda number, stack: pressed.set())
    try:
        while not pressed.wait(period):  # a wait without an end would not let signals through on Windows
            look()
    finally:
        signal.signal(signal.SIGINT, before)


def shown_state(problem: Callable[[], str], show: Callable[[str], None]) -> Callable[[], None]:
    """Return what shows whether goals can be driven, or for what is waited, whenever that changes.

    A text that differs only in its seconds is the same problem.
    """
    known: str | None = None

    def look() -> None:
        nonlocal known
        text = problem()
        kind = SECONDS.sub("", text)
        if kind != known:
            show(f"waiting: {text}" if text else "move_base_flex is ready")
        known = kind

    return look
