"""What a point, a pose or a path on a mesh costs, and where a round robot fits.

The robot is a disc of its inscribed radius, grown by the safety distance, lying on the surface; its part of the map
are the vertices below it that are connected to the place it stands on, so the storeys above and below do not count.

- OUTSIDE: no surface within ``SURFACE_DISTANCE`` above or below the position, or past a border.
- LETHAL: the disc (of a point: the nearest vertex) touches a lethal vertex or one whose cost is infinite or NaN.
- INSCRIBED: a robot whose centre is at the point, or somewhere below the disc, would touch one.

The map knows at its vertices where the disc touches something, and between them not more: where it touches nothing at
any corner of the face (or at both ends of the edge) that carries its middle, it touches nothing, unless an edge of it
is longer than the disc's radius. So between two free vertices it may come nearer to what is lethal, by up to an eighth
of its radius. Planners take the costs of the ``inflation`` layer for where it touches nothing; beside posts and corners
the distances of that are up to a fifth too long, and a vertex that it leaves free may be LETHAL here.

Deviation from the costmap's answers: a disc has no heading, hence ``angle_tolerance`` never matters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm, scalar_products
from mbf_abstract.maps.queries import CellState, Fit, PlaceAnswer, PlaceCheck, PlaceQuery, PoseAnswer
from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.kernels.mesh.touching_discs import blocked_places, touching_discs
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.borders import beyond_border, on_surface
from mbf_mesh_nav.mesh.locate import SurfaceLocator, SurfacePoint
from mbf_mesh_nav.mesh.topology import MeshTopology

SURFACE_DISTANCE = 0.5
"""How far [m] a position may be off the surface to count as on it; less than a storey, more than a wheel."""

FORBIDDEN_COST = 1.0
"""Ground whose cost reaches this is not driven onto, by a plan or in a recovery, but along the robot's own track."""

ON_EDGE = 1e-12
"""Share of a corner up to which a place lies on the edge opposite to it."""

OUTSIDE = PlaceAnswer(CellState.OUTSIDE, 0.0)


@dataclass(frozen=True, eq=False)
class MeshPlaces:
    """Places on one state of the map, for a robot of ``inscribed_radius`` [m]; poses are in the map's frame."""

    topology: MeshTopology
    locator: SurfaceLocator
    snapshot: MeshSnapshot
    inscribed_radius: float

    def check_point(self, point: Pose) -> PlaceAnswer:
        """State and interpolated cost of the surface at a point."""
        place = self._on_surface(point)
        if place is None:
            return OUTSIDE
        weights = place.barycentric > ON_EDGE
        costs = self.snapshot.costs[self.topology.faces[place.face][weights]]
        cost = float(scalar_products(place.barycentric[weights], costs))
        if self._blocked(np.array([self._nearest_vertex(place)])).any():
            return PlaceAnswer(CellState.LETHAL, cost)
        touched = self._touches(place, self._disc(place, self.inscribed_radius), self.inscribed_radius)
        return PlaceAnswer(CellState.INSCRIBED if touched else CellState.FREE, cost)

    def check_pose(self, pose: Pose, query: PlaceQuery) -> PlaceAnswer:
        """State of the robot's disc at a pose and the sum of the costs of the vertices below it.

        It covers an inscribed place where something lethal is within its radius and the inscribed one.
        """
        place = self._on_surface(pose)
        if place is None:
            return OUTSIDE
        radius = self.inscribed_radius + query.safety_dist
        vertices = self._disc(place, radius)
        blocked, costs = self._blocked(vertices), self.snapshot.costs[vertices]
        costs = np.where(blocked, costs * query.lethal_cost_mult, costs)
        if self._touches(place, vertices, radius):
            return PlaceAnswer(CellState.LETHAL, float(costs.sum()))
        around = self._disc(place, 2.0 * self.inscribed_radius + query.safety_dist)
        state = CellState.INSCRIBED if self._blocked(around).any() else CellState.FREE
        return PlaceAnswer(state, float(costs.sum()))

    def fit_check(self, query: PlaceQuery) -> Callable[[FloatArray], NDArray[np.int8]]:
        """Return a function: the ``Fit`` (n,) at positions (n, 3) [m], by ``check_pose`` and ``check_on_path``."""
        mesh, snapshot = self.topology, self.snapshot
        graph = mesh.vertices, mesh.faces, mesh.neighbour_offsets, mesh.neighbours
        radius, room = float(self.inscribed_radius + query.safety_dist), float(query.safety_dist)
        touched = snapshot.lethal | ~np.isfinite(snapshot.costs)
        forbidden = snapshot.lethal | ~(snapshot.costs < FORBIDDEN_COST)

        def fit(positions: FloatArray) -> NDArray[np.int8]:
            location = self.locator.locate(positions, SURFACE_DISTANCE)
            on_surface = (location.faces >= 0) & ~beyond_border(mesh, positions, location)
            places = location.points[on_surface], location.faces[on_surface]
            free = ~touching_discs(*graph, touched, *places, radius, ON_EDGE)
            on_paths = ~blocked_places(*graph, forbidden, *places, room, ON_EDGE)
            found = np.full(len(positions), Fit.TOUCHES, dtype=np.int8)
            found[on_surface] = np.where(free, np.where(on_paths, Fit.FREE, Fit.OFF_PATHS), Fit.TOUCHES)
            return found

        return fit

    def check_on_path(self, pose: Pose, room: float = 0.0) -> PlaceAnswer:
        """State and cost of the vertex nearest to a robot's centre: LETHAL if no plan would touch it.

        Ground is free where the nearest corner of its face is, see ``kernels.search.forbidden_surface``. With ``room``
        [m] all corners of the face count, and all vertices within it: small errors keep the robot on free ground.
        """
        place = self._on_surface(pose)
        if place is None:
            return OUTSIDE
        vertices = np.array([self._nearest_vertex(place)])
        if room > 0.0:
            corners = self.topology.faces[place.face][place.barycentric > ON_EDGE]
            vertices = np.concatenate([corners, self._disc(place, room)])
        costs, lethal = self.snapshot.costs[vertices], self.snapshot.lethal[vertices]
        is_free = bool(np.all((costs < FORBIDDEN_COST) & ~lethal))
        return PlaceAnswer(CellState.FREE if is_free else CellState.LETHAL, float(costs.max()))

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, query: PlaceQuery, fits: PlaceCheck | None = None
    ) -> PoseAnswer:
        """Nearest pose within ``dist_tolerance`` [m] where the robot fits: the pose itself, else a vertex near it.

        ``fits`` is the check of a pose; by default that of the disc, ``check_pose``. Near a pose on the surface only
        vertices of the same storey count; a tolerance of inf means anywhere on it.
        """
        check = fits or (lambda there: self.check_pose(there, query))
        first = check(pose)
        if first.state < CellState.LETHAL:
            return PoseAnswer(first.state, first.cost, pose)
        vertices, place = self.topology.vertices, self._on_surface(pose)
        everywhere = np.arange(len(vertices), dtype=np.int32)
        near = everywhere if place is None else self._disc(place, dist_tolerance)
        near = near[~self._blocked(near)]
        distances = norm(vertices[near] - np.array(pose.position))
        order = np.argsort(distances, kind="stable")
        for vertex in near[order[distances[order] <= dist_tolerance]]:
            x, y, z = vertices[vertex].tolist()
            there = replace(pose, position=(x, y, z))
            answer = check(there)
            if answer.state < CellState.LETHAL:
                return PoseAnswer(answer.state, answer.cost, there)
        return PoseAnswer(first.state, first.cost, None)

    def _on_surface(self, pose: Pose) -> SurfacePoint | None:
        return on_surface(self.topology, self.locator, pose.position, SURFACE_DISTANCE)

    def _touches(self, place: SurfacePoint, disc: IntArray, radius: float) -> bool:
        """Whether the disc of a radius [m] about a place, of which ``disc`` are the vertices, touches something."""
        if not self._blocked(disc).any():
            return False
        mesh = self.topology
        corners = mesh.faces[place.face][place.barycentric > ON_EDGE].tolist()
        around = mesh.vertices[corners]
        if norm(around - np.roll(around, 1, axis=0)).max() > radius:
            return True
        graph = (mesh.vertices, mesh.neighbour_offsets, mesh.neighbours)
        return any(
            self._blocked(vertices_in_disc(*graph, corner, mesh.vertices[corner], float(radius))).any()
            for corner in corners
        )

    def _nearest_vertex(self, place: SurfacePoint) -> int:
        return int(self.topology.faces[place.face][np.argmax(place.barycentric)])

    def _disc(self, place: SurfacePoint, radius: float) -> IntArray:
        mesh = self.topology
        graph = (mesh.vertices, mesh.neighbour_offsets, mesh.neighbours)
        return vertices_in_disc(*graph, self._nearest_vertex(place), place.point, float(radius))

    def _blocked(self, vertices: IntArray) -> BoolArray:
        snapshot = self.snapshot
        return np.asarray(snapshot.lethal[vertices] | ~np.isfinite(snapshot.costs[vertices]))
