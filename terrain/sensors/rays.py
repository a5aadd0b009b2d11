"""Batches of rays at a world: a tree of boxes for what stands still, Bullet for what moves.

The tree is built once. Bullet knows where moving bodies are at each instant. A range sensor takes the nearer of the two
answers. Embree is not used: its ranges differ by up to 0.1 mm from one CPU's instruction set to the next, and so would
every drive by lidar (docs/decisions/0013).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm
from terrain.kernels.ray_casting import first_distances
from terrain.kernels.ray_tree import build_tree
from terrain.physics.actors import Fellow
from terrain.physics.world import MOVING, BulletWorld
from terrain.worlds.upright_solids import SolidRays


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
        self._tree: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8], FloatArray] | None = None
        if len(faces):
            tree = build_tree(
                np.ascontiguousarray(vertices, dtype=np.float64), np.ascontiguousarray(faces, dtype=np.int32)
            )
            boxes, children, far_first, leaves = tree
            self._tree = boxes.ravel(), children.ravel(), far_first.ravel(), leaves.ravel()

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
        hit, points = self._world.cast_rays(origins, origins + max_range * directions, MOVING)
        return np.where(hit, norm(points - origins), np.inf)


class FellowRays:
    """Rays at other robots that navigate, which are boxes to them in every world."""

    def __init__(self, fellows: Sequence[Fellow]) -> None:
        self._fellows = fellows

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Cast the rays; see ``RayCaster``."""
        return SolidRays([fellow.solid() for fellow in self._fellows]).distances(origins, directions, max_range)
