"""A PyBullet world of its own: started quietly, and with a clear error where PyBullet is missing.

PyBullet's C++ side prints straight to the process's output (a build line on import, warnings without a line end on
loading). That would mix with our own output, so such calls happen inside ``quiet_native_output``.
"""

from __future__ import annotations

from typing import Any

from mbf_abstract.native_output import quiet_native_output

GRAVITY = 9.81  # m/s^2


class SimulatorMissingError(ImportError):
    """PyBullet is not installed; the text names the command that installs it."""


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
