"""The one door to PyBullet: import it quietly, and say what to install where it is missing.

PyBullet's C++ side prints to the process's standard output (a build line on import, warnings without a line end on
loading). That output would glue onto ours, so both happen inside ``quiet_native_output``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class SimulatorMissingError(ImportError):
    """PyBullet is not installed; the text says how to get it."""


@contextmanager
def quiet_native_output() -> Iterator[None]:
    """Send what native code prints to standard output to nowhere, for the duration of the block.

    Works on file descriptor 1, so it also hides what another thread prints meanwhile: keep the block short.
    """
    sys.stdout.flush()
    try:
        kept = os.dup(1)
    except OSError:  # this process has no standard output: nothing to hide
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(nowhere)
        os.close(kept)


def load_pybullet() -> Any:
    """Return the ``pybullet`` module.

    Raises
    ------
    SimulatorMissingError
        It cannot be imported.
    """
    if "pybullet" in sys.modules:
        return sys.modules["pybullet"]
    try:
        with quiet_native_output():
            import pybullet
    except ImportError as error:
        raise SimulatorMissingError("this world needs PyBullet: pip install 'mbf-flex[sim]'") from error
    return pybullet
