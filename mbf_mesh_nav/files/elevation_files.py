"""Elevation models as meshes: rasters of heights (GeoTIFF, ESRI ASCII, SRTM), read by whatever package can read them.

This package parses no raster. One that does offers a function by an entry point of the group
``mbf.elevation_readers``, named by the ending without its dot: ``read(path, max_samples)`` returns heights (ny, nx)
[m], NaN where the survey has none, with the southern row first, and the distances dx and dy [m] between samples. It
refuses a raster of more than ``max_samples`` heights before it reads them. Whatever it raises becomes a ``MeshError``.

A void stays a hole in the mesh: where nothing was measured, there is no surface to drive on.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.config.installed_plugins import installed_points
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

READERS_GROUP = "mbf.elevation_readers"

ElevationReader = Callable[[Path, int], tuple[NDArray[Any], float, float]]


def elevation_readers() -> dict[str, EntryPoint]:
    """Readers of elevation models by ending, such as ".tif"; not loaded yet."""
    return {f".{point.name}": point for point in installed_points(READERS_GROUP)}


def read_elevation(path: Path, max_faces: int) -> tuple[FloatArray, NDArray[np.int64]]:
    """Read an elevation model whose ending is in ``elevation_readers()``.

    Returns
    -------
    vertices : (V, 3) float64
        Row by row from the south-western sample, which lies at x = y = 0 [m]; z is NaN at voids.
    faces : (F, 3) int64
        None of them at a void.

    Raises
    ------
    MeshError
        The file cannot be read, has more than ``max_faces`` faces, or no four known heights side by side.
    """
    try:
        read: ElevationReader = elevation_readers()[path.suffix.lower()].load()
        heights, dx, dy = read(path, max_faces // 2)  # two faces between four samples
        vertices, faces = heightfield_mesh(heights, dx, dy, keep_grid=True)
        if not len(faces):
            raise MeshError(str(path), [_without_faces(heights)])
    except MeshError:
        raise
    except Exception as error:  # whatever the reader of another package raises
        reason = str(error).removeprefix(f"{path}: ").removeprefix("cannot be read: ")
        raise MeshError(str(path), [f"cannot be read as an elevation model: {reason}"]) from error
    return vertices, faces.astype(np.int64)


def _without_faces(heights: NDArray[Any]) -> str:
    """Why heights (ny, nx) make no surface."""
    known, (rows, columns) = int(np.isfinite(heights).sum()), heights.shape
    got = f"got {known} known ones of {rows} x {columns}" if known else f"got {rows} x {columns} voids"
    return f"expected four known heights side by side, {got}; no number and the file's no-data value are voids"
