"""Whether a position is on the surface, or past one of its borders."""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.mesh.locate import Location, SurfaceLocator, SurfacePoint
from mbf_mesh_nav.mesh.topology import MeshTopology

BORDER_SLACK = 0.05
"""A position may be so far [m] past a border of the surface and count as on it: rounding, and the width of a wheel."""
ON_EDGE = 1e-9


def beyond_border(topology: MeshTopology, places: FloatArray, location: Location) -> BoolArray:
    """Whether positions (n, 3) [m] lie past a border of the surface, by more than ``BORDER_SLACK`` sideways.

    The surface point nearest to such a position lies on a border edge, and not below or above it. ``location`` is that
    of the places; those without a face are not beyond a border.
    """
    on_surface = np.maximum(location.faces, 0)
    offsets = np.where(location.faces[:, None] >= 0, places - location.points, 0.0)
    normals = topology.face_normals[on_surface]
    sideways = offsets - (offsets * normals).sum(axis=1, keepdims=True) * normals
    # Side i of a face runs from corner i to the next, so it is opposite to the corner after that. In a vertex the face
    # may be any of those around it.
    near = np.nan_to_num(location.barycentric, nan=1.0) > ON_EDGE
    on_border = (~np.roll(near, -2, axis=1) & (topology.face_neighbours[on_surface] < 0)).any(axis=1)
    in_vertex = near.sum(axis=1) == 1
    on_border |= in_vertex & (near & topology.border_vertices[topology.faces[on_surface]]).any(axis=1)
    return np.asarray(on_border & (norm(sideways) > BORDER_SLACK))


def on_surface(
    topology: MeshTopology, locator: SurfaceLocator, position: FloatArray | tuple[float, ...], reach: float
) -> SurfacePoint | None:
    """Return the surface point of a position (3,) at most ``reach`` [m] above or below it, None also past a border."""
    point = locator.locate_one(position, reach)
    if point is None or point.distance <= BORDER_SLACK or min(point.barycentric.tolist()) > ON_EDGE:
        return point  # too near, or inside a face: not past a border
    place = np.asarray(position, dtype=np.float64)[None]
    location = Location(
        np.array([point.face], dtype=np.int32), point.barycentric[None], point.point[None], np.array([point.distance])
    )
    return None if beyond_border(topology, place, location)[0] else point
