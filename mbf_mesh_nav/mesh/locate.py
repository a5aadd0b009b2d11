"""Nearest-face and ray queries: exact, over a box tree of the faces.

The nearest surface point is found over all faces, not only those around the nearest vertex, so long thin triangles
and stacked storeys give the right face, and a point within the distance limit always gets one. Where two faces are
equally near (on their edge) either may come back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.bounding_boxes import build_boxes, closest_face, closest_faces
from mbf_mesh_nav.kernels.mesh.rays import first_hits
from mbf_mesh_nav.mesh.topology import MeshTopology, morton_order

SORT_FROM = 100
"""Number of points from which sorting them costs less than the cache misses it saves."""


@dataclass(frozen=True, eq=False)
class Location:
    """Nearest surface points of n points.

    Attributes
    ----------
    faces : (n,) int32
        The face, -1 where the surface is farther than the limit.
    barycentric : (n, 3) float64
        Weights of the face's corners, NaN without a face.
    points : (n, 3) float64
        The surface points [m], NaN without a face.
    distances : (n,) float64
        Distances to them [m], inf without a face.
    """

    faces: IntArray
    barycentric: FloatArray
    points: FloatArray
    distances: FloatArray


class SurfacePoint(NamedTuple):
    """A point on the surface: face, barycentric weights of its corners, position [m], distance to the query [m]."""

    face: int
    barycentric: FloatArray
    point: FloatArray
    distance: float


class SurfaceLocator:
    """Nearest-point and ray queries on one mesh; building it is linear in the faces."""

    def __init__(self, topology: MeshTopology) -> None:
        boxes, levels = build_boxes(topology.vertices, topology.faces)
        self._tree = (topology.vertices, topology.faces, boxes, levels)

    def locate(self, points: ArrayLike, max_distance: float = np.inf) -> Location:
        """Nearest surface points of many points.

        Parameters
        ----------
        points : (n, 3) float
            Positions [m].
        max_distance : float
            Limit [m]; farther away there is no face.

        Raises
        ------
        ValueError
            The points do not have three coordinates each.
        """
        queries = _rows(points)
        known = np.where(np.isfinite(queries), queries, 0.0)  # the others come anywhere
        order = np.arange(len(queries)) if len(queries) < SORT_FROM else morton_order(known, known)
        return Location(*closest_faces(*self._tree, queries, order, float(max_distance)))

    def locate_one(self, point: ArrayLike, max_distance: float = np.inf, hint_face: int = -1) -> SurfacePoint | None:
        """Nearest surface point of one point, or None beyond ``max_distance``.

        Parameters
        ----------
        point : (3,) float
            Position [m].
        hint_face : int
            A face likely to be near, e.g. the last answer of a moving robot; the answer does not depend on it.
        """
        x, y, z = np.asarray(point, dtype=np.float64).tolist()
        face, distance, v, w, px, py, pz = closest_face(*self._tree, x, y, z, float(max_distance), int(hint_face))
        if face < 0:
            return None
        return SurfacePoint(face, np.array([1.0 - v - w, v, w]), np.array([px, py, pz]), distance)

    def cast_rays(
        self, origins: ArrayLike, directions: ArrayLike, max_distance: float = np.inf
    ) -> tuple[IntArray, FloatArray]:
        """First hits of rays, from either side of a face.

        Parameters
        ----------
        origins, directions : (n, 3) float
            Start points [m] and unit directions.

        Returns
        -------
        faces : (n,) int32
            -1 = no hit within ``max_distance``.
        distances : (n,) float64
            Along the ray [m], inf without a hit.
        """
        starts = _rows(origins)
        headings = np.empty(starts.shape)
        headings[:] = directions
        return first_hits(*self._tree, starts, headings, float(max_distance))


def _rows(points: ArrayLike) -> FloatArray:
    """Copy of points as (n, 3), writable: one type for the kernels. Without a look, columns would pass for rows."""
    rows = np.array(points, dtype=np.float64)
    if rows.size and rows.shape[-1] != 3:
        raise ValueError(f"points must be an array (n, 3) of coordinates, got one of shape {rows.shape}")
    return rows.reshape(-1, 3)
