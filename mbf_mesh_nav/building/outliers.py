"""Clouds that are no map, and isolated points: errors of a sensor, insects, rain."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.mesh.mesh_report import MeshError

LEAST_POINTS = 100
FARTHEST_CELL = 2**20
"""Voxels along each axis; 60 bits number them all."""


def isolated_points(points: FloatArray, voxel: float, least: int) -> BoolArray:
    """Mask (n,) of the points with fewer than ``least`` points in their voxel and the 26 around it, itself included.

    Parameters
    ----------
    points : (n, 3) float64
    voxel : float
        Edge of a voxel [m].
    """
    lower = points.min(axis=0)
    keys = np.zeros(len(points), dtype=np.int64)
    for axis in range(3):
        place = np.minimum((points[:, axis] - lower[axis]) / voxel, FARTHEST_CELL - 3).astype(np.int64) + 1
        keys = keys * FARTHEST_CELL + place
    voxels, voxel_of_point, counts = np.unique(keys, return_inverse=True, return_counts=True)
    around = np.zeros(len(voxels), dtype=np.int64)
    steps = (-1, 0, 1)
    for offset in ((x * FARTHEST_CELL + y) * FARTHEST_CELL + z for x in steps for y in steps for z in steps):
        place = np.minimum(np.searchsorted(voxels, voxels + offset), len(voxels) - 1)
        around += np.where(voxels[place] == voxels + offset, counts[place], 0)
    return np.asarray((around < least)[voxel_of_point.ravel()])


def refuse_degenerate(points: FloatArray) -> None:
    """Refuse points (n, 3) that cannot be a map: too few, all in one place or on one line in the plan view."""
    if len(points) < LEAST_POINTS:
        raise MeshError("point cloud", [f"{len(points)} points are too few for a map, the least is {LEAST_POINTS}"])
    x, y = points[:, 0] - points[:, 0].mean(), points[:, 1] - points[:, 1].mean()
    xx, xy, yy = float((x * x).sum()), float((x * y).sum()), float((y * y).sum())
    spread = 0.5 * (xx + yy)
    across = spread - float(np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy))  # the smaller eigenvalue of the scatter matrix
    if across <= 1e-6 * spread:
        raise MeshError("point cloud", ["all of its points lie on one line in the plan view"])
