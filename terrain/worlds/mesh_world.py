"""Any triangle mesh file as a world: a scan of a building, a garage, a game level.

Wheels roll on every face of it, and faces that stand steeply are its walls. The mesh server's reader reads it, so that
world and map agree on the axes and the unit of a file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mbf_abstract.config.registry import PluginError, PluginRegistry
from terrain.worlds.surface import Surface


class MeshFileError(Exception):
    """A mesh file cannot be used as a world; the text names the file and the reason."""


def read_mesh_world(path: str | Path, up_axis: str = "", unit: float = 0.0) -> Surface:
    """Read the triangles of a mesh file in any format that the mesh server reads.

    Parameters
    ----------
    up_axis : str
        Axis of the file that points up, "x", "y" or "z"; "" = as in the file or its format.
    unit : float
        Length of the file's unit [m]; 0 = as in the file, or 1.

    Raises
    ------
    MeshFileError
        No such file, no triangles in it, or a coordinate that is not finite; or no mesh server is installed.
    """
    try:
        server: Any = PluginRegistry().load("servers", "mesh")
        vertices, faces = server.read_mesh(path, up_axis=up_axis, unit=unit)
    except (PluginError, ValueError) as error:
        raise MeshFileError(str(error)) from error
    if not np.isfinite(vertices).all():
        raise MeshFileError(f"{path}: vertex {int(np.argwhere(~np.isfinite(vertices))[0, 0])} is not finite")
    return Surface(vertices, faces.astype(np.int32))
