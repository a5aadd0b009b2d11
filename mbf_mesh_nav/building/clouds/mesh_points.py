"""Meshes as point clouds: photogrammetry and scans whose triangles are no map yet, sampled evenly.

A photogrammetry mesh has trees, walls and double surfaces, and often no connection between its parts. Sampled, it is
treated as any scan. Points follow the R2 sequence (Martin Roberts, "The Unreasonable Effectiveness of Quasirandom
Sequences", 2018), so the same file gives the same points.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.building.clouds.stored_points import StoredPoints
from mbf_mesh_nav.building.clouds.undersides import out_of_reach
from mbf_mesh_nav.files.mesh_io import HDF5_FORMATS, TRIMESH_FORMATS, read_mesh
from mbf_mesh_nav.mesh.mesh_report import MeshError

MESH_ENDINGS = (TRIMESH_FORMATS | HDF5_FORMATS) - {".ply"}
"""Endings of files that are always meshes; a PLY is one if it has faces."""
LEAST_DENSITY = 100.0
"""Samples of a square metre; more if the mesh has more vertices."""
R2 = (0.7548776662466927, 0.5698402909980532)


def read_mesh_points(path: Path, max_points: int, up_axis: str, unit: float, clearance: float) -> StoredPoints:
    """Sample the faces of a mesh file.

    Parameters
    ----------
    up_axis, unit
        As in ``files.mesh_io.read_mesh``.
    clearance : float
        Free height [m] that the robot needs below what solids carry.

    Returns
    -------
    StoredPoints
        In metres with z up.

    Raises
    ------
    MeshError
        The mesh cannot be read, its faces have no area, or it needs more than ``max_points`` samples.
    """
    vertices, faces = read_mesh(path, up_axis=up_axis, unit=unit)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    areas = 0.5 * np.sqrt(np.sum(normals * normals, axis=1))
    areas = np.where(np.isfinite(areas), areas, 0.0)
    area = float(areas.sum())
    if area == 0.0:
        raise MeshError(str(path), ["its faces have no area"])
    density = max(LEAST_DENSITY, len(vertices) / area)
    if area * density > max_points:
        text = f"{area:.6g} m² of faces need {area * density:.0f} samples, the limit is {max_points} (max_points)"
        raise MeshError(str(path), [text])
    points, face = _samples(a, b - a, c - a, areas * density)
    notes = [f"{len(faces)} faces sampled with {density:.0f} points/m²"]
    is_hidden = out_of_reach(vertices, faces, points, face, clearance)
    if is_hidden.any():
        points = points[~is_hidden]
        text = "on solids with no ground below, or less than the clearance above it"
        notes.append(f"{np.count_nonzero(is_hidden)} samples left out, {text}")
    return StoredPoints(points, notes=tuple(notes))


def _samples(
    corner: FloatArray, along: FloatArray, across: FloatArray, wanted: FloatArray
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Points (n, 3) on triangles (F, 3), and the triangle of each.

    A triangle has ``wanted`` (F,) points on average; what is left over goes to the next one.
    """
    ends = np.floor(np.cumsum(wanted)).astype(np.int64)
    face: NDArray[np.int64] = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
    number = np.arange(len(face), dtype=np.float64)
    u, v = (np.mod(number * step, 1.0)[:, None] for step in R2)
    is_outside = u + v > 1.0
    u, v = np.where(is_outside, 1.0 - u, u), np.where(is_outside, 1.0 - v, v)
    return corner[face] + u * along[face] + v * across[face], face
