"""Whether a position is on the surface, or past one of its borders."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.kernels.mesh.borders import past_borders
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
    mesh = topology.faces, topology.face_normals, topology.face_neighbours, topology.border_vertices
    found = location.faces, location.barycentric, location.points
    return np.asarray(past_borders(*mesh, np.array(places, dtype=np.float64), *found, BORDER_SLACK, ON_EDGE))


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
