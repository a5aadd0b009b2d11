"""Silence for native code, which prints straight to the process's output, such as PyBullet when it is imported."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2


@contextmanager
def quiet_native_output() -> Iterator[None]:
    """Discard what native code prints during the block; exceptions pass.

    Works on file descriptors, so it also hides what other threads print during the block: keep it short.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    with ExitStack() as streams:
        for descriptor in (STANDARD_OUTPUT, STANDARD_ERROR):
            streams.enter_context(_silenced(descriptor))
        yield


@contextmanager
def _silenced(descriptor: int) -> Iterator[None]:
    try:
        kept = os.dup(descriptor)
    except OSError:  # the process was started without this stream: nothing to hide
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, descriptor)
        yield
    finally:
        _flush_native_buffers()  # text that C still buffers would come out after the block
        os.dup2(kept, descriptor)
        os.close(nowhere)
        os.close(kept)


def _flush_native_buffers() -> None:
    if os.name == "posix":
        ctypes.CDLL(None).fflush(None)
