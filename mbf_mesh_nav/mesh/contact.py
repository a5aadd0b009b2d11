"""How a robot that touches something on a mesh may move: nothing deeper, and nothing else.

When to use: where the robot stands on ground that is forbidden because of lethal vertices near by, or nearer to one
than its radius. When not: on other ground, where ``kernels.search.forbidden_surface`` has the rule.

Within the inscribed radius all ground costs the same, and where it begins is a line of teeth as wide as an edge. So a
rank by cost neither forbids to press deeper into a wall, nor allows to leave it at a small angle, over the next tooth.
What counts is the distance of the centre from the nearest lethal vertex, thing by thing, as on costmaps: lethal
vertices that are joined by edges are one thing. Between the corners of a face that distance is interpolated. Ground is
free where the nearest vertex is, so beside a corner of a wall a robot touches it on free ground, too; but only where
the map is inflated: on others plans lead nearer to lethal vertices.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry.arithmetic import cross_product, norm, scalar_products
from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.kernels.mesh.vectors import Vector
from mbf_mesh_nav.kernels.search.forbidden_surface import LETHAL_RANK, rank_at
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.positions import vector_of
from mbf_mesh_nav.mesh.topology import MeshTopology

ROUNDING = 0.1
"""How much [mean edges] deeper counts as no deeper: along a wall of vertices the distance goes up and down so far."""
TOOTH = 0.5
"""How far [mean edges] the forbidden ground reaches beyond the inscribed radius."""
LEAST = 1e-3
"""Depth [m] of a robot on forbidden ground beyond that."""


class Contact:
    """What a robot touches where a motion begins, and how deep it may get in it.

    Parameters
    ----------
    mesh : MeshTopology
    ranks : (V,) float32
        How forbidden the vertices are, see ``MeshSnapshot.traversability_rank``.
    things : list of (n, 3) float64
        Lethal vertices [m] near the motion, those of one thing together.
    place : SurfacePoint
        Where the motion begins.
    reach : float
        A lethal vertex nearer than this [m] is touched.
    """

    def __init__(
        self, mesh: MeshTopology, ranks: Float32Array, things: list[FloatArray], place: SurfacePoint, reach: float
    ) -> None:
        self._mesh, self._ranks, self._things, self._reach = mesh, ranks, things, reach
        # On free ground at the edge of forbidden ground that of the teeth: it may be the next one that it leaves over.
        corners = ranks[mesh.faces[place.face]]
        self._rank = self._rank_of(place.face, place.barycentric) or float(corners[corners < LETHAL_RANK].max())
        self._limits = self._depths(place.face, place.barycentric)
        self._rounding = ROUNDING * mesh.mean_edge_length

    @classmethod
    def at(
        cls, mesh: MeshTopology, ranks: Float32Array, place: SurfacePoint, radius: float, travel: float
    ) -> Contact | None:
        """The contact of a robot of a ``radius`` [m] that is about to drive ``travel`` [m]; None if it is in none.

        ``ranks`` (V,) float32: how forbidden the vertices are, see ``MeshSnapshot.traversability_rank``.
        """
        corners = ranks[mesh.faces[place.face]]
        if not corners.any():
            return None
        graph = (mesh.vertices, mesh.neighbour_offsets, mesh.neighbours)
        nearest = int(np.argmax(place.barycentric))
        start = int(mesh.faces[place.face, nearest])
        if corners[nearest] == 0.0:
            inflated = bool(((corners > 0.0) & (corners < LETHAL_RANK)).any())
            if not inflated or (ranks[vertices_in_disc(*graph, start, place.point, radius)] < LETHAL_RANK).all():
                return None
        reach = radius + TOOTH * mesh.mean_edge_length
        near = vertices_in_disc(*graph, start, place.point, float(reach + travel + 2.0 * mesh.mean_edge_length))
        lethal = near[ranks[near] >= LETHAL_RANK]
        found = cls(mesh, ranks, things_of(mesh, lethal), place, reach)
        return found if found.depth > 0.0 else None

    @property
    def depth(self) -> float:
        """How deep [m] the robot lies in the deepest of the things where the motion begins; 0 = in none."""
        return float(self._limits.max(initial=0.0))

    def allows(self, face: int, point: Vector, rank: float) -> bool:
        """Whether the motion may come, from where it was asked for last, to a point [m] of a face and of a ``rank``.

        A thing that was left must not be touched again. Between two teeth the robot has not left it.
        """
        shares = shares_of(self._mesh.vertices[self._mesh.faces[face]], np.array(point))
        depths = self._depths(face, shares)
        deeper = bool((depths > self._limits + self._rounding).any())
        if rank > 0.0 and (deeper or self._rank_of(face, shares) > self._rank):
            return False
        self._limits = np.where(depths > 0.0, self._limits, 0.0)
        return True

    def _rank_of(self, face: int, shares: FloatArray) -> float:
        return float(self._ranks[self._mesh.faces[face, np.argmax(shares)]])

    def _depths(self, face: int, shares: FloatArray) -> FloatArray:
        """Depth (k,) [m] in each thing, at least 0, at a point of a face."""
        corners = self._mesh.vertices[self._mesh.faces[face]]
        gaps = [float(scalar_products(norm(corners[:, None] - one[None]).min(axis=1), shares)) for one in self._things]
        return np.maximum(self._reach - np.array(gaps, dtype=np.float64), 0.0)


def contact_depth(mesh: MeshTopology, ranks: Float32Array, place: SurfacePoint, radius: float) -> float:
    """How deep [m] a robot of a ``radius`` [m] lies in what it touches at a place; 0 where it touches nothing.

    ``ranks`` (V,) as in ``Contact.at``.
    """
    contact = Contact.at(mesh, ranks, place, radius, 0.0)
    if contact is None:
        return LEAST if rank_at(mesh.vertices, mesh.faces, ranks, place.face, vector_of(place.point)) > 0.0 else 0.0
    return max(contact.depth, LEAST)


def things_of(mesh: MeshTopology, vertices: IntArray) -> list[FloatArray]:
    """Positions [m] of vertices (k,), those that are joined by edges among them in one array (n, 3)."""
    left, things = dict.fromkeys(vertices.tolist()), []
    while left:
        members = [left.popitem()[0]]
        for vertex in members:
            row = slice(mesh.neighbour_offsets[vertex], mesh.neighbour_offsets[vertex + 1])
            members += [other for other in mesh.neighbours[row].tolist() if left.pop(other, other) is None]
        things.append(mesh.vertices[members])
    return things


def shares_of(corners: FloatArray, point: FloatArray) -> FloatArray:
    """Barycentric coordinates (3,) of a point [m] in the plane of a face with ``corners`` (3, 3) [m]."""
    first, second = corners[1:] - corners[0]
    normal, offset = cross_product(first, second), point - corners[0]
    squared = float(scalar_products(normal, normal))
    b = float(scalar_products(cross_product(offset, second), normal)) / squared
    c = float(scalar_products(cross_product(first, offset), normal)) / squared
    return np.array([1.0 - b - c, b, c])
