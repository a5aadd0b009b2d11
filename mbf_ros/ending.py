"""How commands that run for as long as they are wanted come to their end."""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import typer

from mbf_abstract.commands.reporting import FAILURE

SECONDS = re.compile(r"-?[\d.]+ s\b")


class Parent:
    """The process that started this one; made when a command begins.

    Where it is gone, e.g. a launch file that was killed, nobody might be left who could stop the robot. Where SIGHUP
    is ignored, as after ``nohup``, the command is to outlive it. Windows does not say when it is gone.
    """

    def __init__(self) -> None:
        self._process = os.getppid()

    def end_without(self) -> None:
        """Raise typer.Exit where it is gone; what is open is closed, and stops the robot."""
        if os.getppid() == self._process or signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
            return
        with suppress(OSError):  # whoever read what is printed may be gone, too
            typer.echo(
                "error: the process that started this command has ended, so the robot is stopped; to let it go on by "
                "itself start it with nohup or as a service",
                err=True,
            )
        raise typer.Exit(FAILURE)


@contextmanager
def noticed_ctrl_c() -> Iterator[threading.Event]:
    """Yield what Ctrl-C sets meanwhile.

    SIGTERM ends the program by an exception, see ``server.process_end``.
    """
    pressed = threading.Event()
    before = signal.signal(signal.SIGINT, lambda number, stack: pressed.set())
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, before)


def wait_for_ctrl_c(parent: Parent, look: Callable[[], None] = lambda: None, period: float = 0.2) -> None:
    """Wait for Ctrl-C, or the end of the parent, and call ``look`` every ``period`` [s] until then."""
    with noticed_ctrl_c() as pressed:
        while not pressed.wait(period):  # a wait without an end would not let signals through on Windows
            look()
            parent.end_without()


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
