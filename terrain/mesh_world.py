"""Any triangle mesh file as a world: a scan of a building, a garage, a game level.

Wheels roll on every face of it, and faces that stand steeply are its walls. Z must be up and lengths in metres; a file
that is not is brought there by ``scale`` and ``y_up``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from terrain.sheets import TriangleMesh


class MeshFileError(Exception):
    """A mesh file cannot be used as a world; the text names the file and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(f"{path}: {reason}")


def read_mesh_world(path: str | Path, scale: float = 1.0, y_up: bool = False) -> TriangleMesh:
    """Read the triangles of a mesh file in any format that trimesh knows.

    Parameters
    ----------
    scale : float
        Metres per unit of the file.
    y_up : bool
        The file's y axis points up, as in most files of computer graphics; turned to z up.

    Raises
    ------
    MeshFileError
        No such file, no triangles in it, or a coordinate that is not finite.
    """
    path = Path(path)
    if not path.is_file():
        raise MeshFileError(path, "no such file")
    try:
        loaded = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # trimesh raises whatever its many format readers raise
        raise MeshFileError(path, f"cannot be read: {type(error).__name__}: {error}") from error
    vertices = np.asarray(getattr(loaded, "vertices", []), dtype=np.float64).reshape(-1, 3) * scale
    faces = np.asarray(getattr(loaded, "faces", []), dtype=np.int32).reshape(-1, 3)
    if not len(faces):
        raise MeshFileError(path, "holds no triangles")
    if not np.isfinite(vertices).all():
        raise MeshFileError(path, f"vertex {int(np.argwhere(~np.isfinite(vertices))[0, 0])} is not finite")
    if y_up:
        vertices = np.column_stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]])
    return TriangleMesh(vertices, faces)
