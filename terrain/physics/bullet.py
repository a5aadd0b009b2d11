"""A PyBullet world of its own: started quietly, and with a clear error where PyBullet is missing.

PyBullet's C++ side prints straight to the process's output (a build line on import, warnings without a line end on
loading). That would mix with our own output, so such calls happen inside ``quiet_native_output``.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

STANDARD_OUTPUT, STANDARD_ERROR = 1, 2
GRAVITY = 9.81  # m/s^2


class SimulatorMissingError(ImportError):
    """PyBullet is not installed; the text names the command that installs it."""


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


def connect(time_step: float) -> Any:
    """Make an empty PyBullet world without a window, with steps of ``time_step`` [s]; return its ``BulletClient``.

    The client has all functions of ``pybullet`` with the number of this world filled in.

    Raises
    ------
    SimulatorMissingError
        PyBullet cannot be imported.
    """
    try:
        with quiet_native_output():
            import pybullet
            from pybullet_utils.bullet_client import BulletClient

            client = BulletClient(pybullet.DIRECT)
    except ImportError as error:
        raise SimulatorMissingError("this world needs PyBullet: pip install 'mbf-flex[sim]'") from error
    client.setGravity(0, 0, -GRAVITY)
    client.setPhysicsEngineParameter(
        fixedTimeStep=time_step,
        numSolverIterations=50,
        deterministicOverlappingPairs=1,
        enableConeFriction=0,  # with the cone on, a skid-steered robot turns at a fifth of the commanded rate
        enableFileCaching=0,  # meshes are cached by file name otherwise, even if the file has changed
    )
    return client
