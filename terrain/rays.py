"""Batches of rays at a world: Embree for what stands still, Bullet for what moves.

Embree casts some ten times more rays a second than Bullet and is exact on heightfields, but its scene is built once.
Bullet knows where moving bodies are at each instant. A range sensor takes the nearer of the two answers.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import norm
from terrain.world import MOVING, BulletWorld

FloatArray = NDArray[np.float64]


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
    """Rays at triangles that do not move, by Embree.

    Parameters
    ----------
    vertices : (n, 3) float64
        [m]; may lie far from zero, the scene gets its own origin because Embree computes in float32.
    faces : (m, 3) int32
    """

    def __init__(self, vertices: FloatArray, faces: NDArray[np.int32]) -> None:
        self._origin = vertices.mean(axis=0) if len(vertices) else np.zeros(3)
        self._scene: Any = None
        if len(faces):
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene

            self._scene = EmbreeScene()
            TriangleMesh(self._scene, (vertices - self._origin).astype(np.float32), faces.astype(np.int32))

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Cast the rays; see ``RayCaster``."""
        if self._scene is None:
            return np.full(len(origins), np.inf)
        starts = np.ascontiguousarray(origins - self._origin, dtype=np.float32)
        far = self._scene.run(starts, np.ascontiguousarray(directions, dtype=np.float32), query="DISTANCE")
        return np.where(far <= max_range, far, np.inf).astype(np.float64)


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
