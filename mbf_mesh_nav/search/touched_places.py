"""Where a changed path makes a round robot touch something that it did not touch near there before."""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.touching_discs import touching_discs
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.places import ON_EDGE
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.search.corridor import Piece

NEAR = 2.0
"""What the robot touched within so many of its radii along the path given, it may touch on the changed one."""


class TouchedPlaces:
    """Places where the disc that stands for the robot touches something lethal, as ``check_pose`` says."""

    def __init__(self, mesh_map: MeshMap, snapshot: MeshSnapshot) -> None:
        self._mesh, self._radius = mesh_map.topology, mesh_map.inscribed_radius
        self._lethal: BoolArray = snapshot.lethal | ~np.isfinite(snapshot.costs)

    def new_faces(self, changed: Piece, given: Piece) -> IntArray:
        """Faces (k,) in which the changed path touches something, and the given one nothing near there."""
        if self._radius == 0.0:
            return changed[1][:0]
        places, faces = _places(changed)
        touched = self._touches(places, faces)
        if not touched.any():
            return faces[:0]
        before, its_faces = _places(given)
        before = before[self._touches(before, its_faces)]
        places, faces = places[touched], faces[touched]
        far = [not (norm(before - place) <= NEAR * self._radius).any() for place in places]
        return np.unique(faces[far])

    def _touches(self, places: FloatArray, faces: IntArray) -> BoolArray:
        mesh, radius = self._mesh, float(self._radius)
        graph = mesh.neighbour_offsets, mesh.neighbours
        touches = touching_discs(mesh.vertices, mesh.faces, *graph, self._lethal, places, faces, radius, ON_EDGE)
        return np.asarray(touches)


def _places(piece: Piece) -> tuple[FloatArray, IntArray]:
    """Points of a path and the middles of its segments, with their faces: inside a face all places touch the same."""
    points, faces = piece
    return np.concatenate([points, 0.5 * (points[1:] + points[:-1])]), np.concatenate([faces, faces[1:]])
