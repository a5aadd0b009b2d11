"""Ctrl-C while worker processes start: it reaches each once it can end without a word.

A terminal interrupts all processes of its foreground. A worker that still imports its modules would print a traceback.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

CAN_WAIT = hasattr(signal, "pthread_sigmask")  # not on Windows


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Let SIGINT wait until the end of the block, and in processes that it starts until ``interrupts_arrive``."""
    if not CAN_WAIT:
        yield
        return
    resource_tracker.ensure_running()  # its own start, which the first worker brings about, ends the wait
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def interrupts_arrive() -> None:
    """Let SIGINT arrive in a worker that was started with ``interrupts_wait``, also one that has come since."""
    if CAN_WAIT:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
