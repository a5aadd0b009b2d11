"""Ctrl-C and SIGTERM, which Python raises on the main thread wherever it is: no fault of the code there."""

from __future__ import annotations

import threading


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
    while cause is not None and not isinstance(cause, KeyboardInterrupt):
        cause = cause.__cause__ or cause.__context__
    return error if isinstance(error, SystemExit) else cause
