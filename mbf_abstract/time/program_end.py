"""Ctrl-C and SIGTERM, which Python raises on the main thread wherever it is: no fault of the code there."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 130
"""Exit code of a program that SIGINT (2) has ended, as shells count: 128 + 2."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C end a program with one line and exit code 130, without a traceback.

    When to use: around all of a script. What it holds in ``with`` blocks is closed before, so the robot stands.
    """
    try:
        yield
    except BaseException as error:
        if not isinstance(end_of_the_program(error), KeyboardInterrupt):
            raise
        print("interrupted", file=sys.stderr, flush=True)  # noqa: T201 - typer may not be there yet
        raise SystemExit(INTERRUPTED) from None


def is_for_the_program(error: BaseException) -> bool:
    """Whether this is Ctrl-C or SIGTERM, which reach the main thread wherever it is, and no fault of the code there."""
    return end_of_the_program(error) is not None


def end_of_the_program(error: BaseException) -> KeyboardInterrupt | SystemExit | None:
    """Return the Ctrl-C or SIGTERM that an error on the main thread is, or the Ctrl-C that it comes from.

    numba turns one that arrives while a kernel runs into a SystemError, and a lock that is left halfway raises, too.
    """
    if threading.current_thread() is not threading.main_thread():
        return None
    cause: BaseException | None = error
    known: set[int] = set()  # an error that was raised from itself is its own cause
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        known.add(id(cause))
        cause = cause.__cause__ or cause.__context__
        cause = None if id(cause) in known else cause
    return error if isinstance(error, SystemExit) else cause
