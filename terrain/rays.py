"""Batches of rays at a world: a tree of boxes for what stands still, Bullet for what moves.

The tree is built once. Bullet knows where moving bodies are at each instant. A range sensor takes the nearer of the two
answers. Embree casts several times as many rays a second but is not used: its ranges differ by up to 0.1 mm from one
CPU's instruction set to the next, and so would every drive by lidar (docs/decisions/0013).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import norm
from terrain.kernels.ray_tree import build_leaves, build_nodes, first_distances, morton_codes
from terrain.world import MOVING, BulletWorld

FloatArray = NDArray[np.float64]

MORTON_CELLS = 2.0**20 - 1.0  # along the longest side, the most that a code has bits for


class RayCaster(Protocol):
    """Something that rays can hit."""

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Return the distance [m] to the first hit of each ray, inf where there is none within ``max_range``.

        Parameters
        ----------
        origins : (n, 3) float64
            [m], in map.
        directions : (n, 3) float64
            Unit length.
        max_range : float
            [m]
        """


class StaticRays:
    """Rays at triangles that do not move.

    Parameters
    ----------
    vertices : (n, 3) float64
        [m]
    faces : (m, 3) int32
    """

    def __init__(self, vertices: FloatArray, faces: NDArray[np.int32]) -> None:
        self._tree: tuple[FloatArray, NDArray[np.int64], FloatArray] | None = None
        if len(faces):
            vertices = np.ascontiguousarray(vertices, dtype=np.float64)
            centres = (vertices[faces[:, 0]] + vertices[faces[:, 1]] + vertices[faces[:, 2]]) / 3.0
            lower, upper = centres.min(axis=0), centres.max(axis=0)
            cell = max(float((upper - lower).max()), 1e-9) / MORTON_CELLS
            order = np.argsort(morton_codes(centres, lower, cell), kind="stable")
            ordered = np.ascontiguousarray(faces[order], dtype=np.int32)
            self._tree = *build_nodes(vertices, ordered), build_leaves(vertices, ordered)

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Cast the rays; see ``RayCaster``."""
        if self._tree is None:
            return np.full(len(origins), np.inf)
        starts = np.ascontiguousarray(origins, dtype=np.float64)
        return first_distances(*self._tree, starts, np.ascontiguousarray(directions, dtype=np.float64), max_range)


class MovingRays:
    """Rays at the moving bodies of a PyBullet world; robots are not hit."""

    def __init__(self, world: BulletWorld) -> None:
        self._world = world

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Cast the rays; see ``RayCaster``."""
        if not self._world.has_moving_bodies:
            return np.full(len(origins), np.inf)
        hits = self._world.cast_rays(origins, origins + max_range * directions, MOVING)
        return np.where(hits.hit, norm(hits.points - origins), np.inf)
