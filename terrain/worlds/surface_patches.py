"""Drivable surfaces on several levels, made of sheets: regular grids with holes, joined where their corners coincide.

A heightfield has one height per place; a garage or a bridge has several. Build each level and each ramp as a sheet,
let neighbours end on the same grid line at the same height, and ``join_sheets`` makes one mesh of them: a planner can
go from sheet to sheet there and nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain.worlds.solids import box_triangles

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

JOIN_DISTANCE = 1e-6  # m; corners nearer than this are one


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles: ``vertices`` (n, 3) float64 [m] and ``faces`` (m, 3) int32, counter-clockwise seen from outside."""

    vertices: FloatArray
    faces: IntArray


def sheet(x: FloatArray, y: FloatArray, z: FloatArray, keep: NDArray[np.bool_] | None = None) -> TriangleMesh:
    """Build a sheet over a grid; its faces look up.

    Parameters
    ----------
    x, y : (nx,), (ny,) float
        Grid lines [m], rising.
    z : (ny, nx) float
        Heights of the grid's corners [m].
    keep : (ny - 1, nx - 1) bool, optional
        Cells that exist; the others are holes.
    """
    gx, gy = np.meshgrid(x, y)
    vertices = np.column_stack([gx.ravel(), gy.ravel(), np.asarray(z, dtype=float).ravel()])
    nx = len(x)
    i = np.arange(len(y) - 1)[:, None] * nx + np.arange(nx - 1)
    if keep is not None:
        i = i[keep]
    i = i.ravel()
    lower, upper = np.stack([i, i + 1, i + nx], axis=-1), np.stack([i + 1, i + nx + 1, i + nx], axis=-1)
    return TriangleMesh(vertices, np.stack([lower, upper], axis=1).reshape(-1, 3).astype(np.int32))


def join_sheets(parts: Sequence[TriangleMesh]) -> TriangleMesh:
    """Make one mesh: corners at the same place become one vertex, corners that no face uses go."""
    vertices, faces = _stack(parts)
    keys = np.rint(vertices / JOIN_DISTANCE).astype(np.int64)
    _, first, where = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    joined = where.ravel()[faces]
    used, compact = np.unique(joined, return_inverse=True)
    return TriangleMesh(vertices[first[used]], compact.reshape(-1, 3).astype(np.int32))


def stack_meshes(parts: Sequence[TriangleMesh]) -> TriangleMesh:
    """Put meshes side by side without joining anything, as for walls."""
    return TriangleMesh(*_stack(parts))


def _stack(parts: Sequence[TriangleMesh]) -> tuple[FloatArray, IntArray]:
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part.vertices for part in parts]), np.concatenate(faces).astype(np.int32)


def box_between(low: Sequence[float], high: Sequence[float]) -> TriangleMesh:
    """Axis-parallel box from corner ``low`` to corner ``high``, each (3,) [m]."""
    corners = np.array([low, high], dtype=float)
    vertices, faces = box_triangles((corners[1] - corners[0]).tolist())
    return TriangleMesh(vertices + corners.mean(axis=0), faces)
