"""What a mesh map answers from its snapshot: the places and the motions of the core's map contract.

No lock is held while a question is answered.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.polyline import places_between
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.queries import PlaceCheck, PlaceQuery, PlaneCheck, PoseAnswer, in_plane
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.map.outline_on_ground import OutlineOnGround
from mbf_mesh_nav.map.places import FORBIDDEN_COST, MeshPlaces
from mbf_mesh_nav.map.places import SURFACE_DISTANCE as OF_PLACES
from mbf_mesh_nav.map.robot_outline import Corners, OutlinedMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.borders import beyond_border
from mbf_mesh_nav.mesh.contact import contact_depth
from mbf_mesh_nav.mesh.locate import Location, SurfaceLocator, SurfacePoint
from mbf_mesh_nav.mesh.motion_check import SURFACE_DISTANCE, forbidden_ahead, nearest_of
from mbf_mesh_nav.mesh.topology import MeshTopology
from mbf_mesh_nav.mesh.turning import pivots, slope_at, swept_obstacle

if TYPE_CHECKING:
    import networkx


PLACES_AN_EDGE = 2.0
"""Places per mean edge of the mesh at which lines between poses are looked up."""
LONG_LINE = 1.5
"""Mean edges; shorter lines between poses are not looked at."""


class SnapshotAnswers(OutlinedMap):
    """The part of a ``MeshMap`` that needs no more than its surface, its snapshot and the robot's size.

    Attributes
    ----------
    topology : MeshTopology
        All arrays in one value; each of them is an attribute of the map, too.
    locator : SurfaceLocator
        Nearest-point and ray queries.
    inscribed_radius : float
        Radius [m] of the disc that stands for the robot when the server is asked where it fits.
    footprint : tuple of (x, y)
        Corners [m] of the robot's outline, for turns on the spot and for contacts with moving objects; empty = that
        disc.
    check_footprint : bool
        Whether the outline, too, has to fit wherever plans and motions lead, see ``outline_on_ground``.
    max_turning_slope : float
        Steeper ground [rad] is not turned on in a recovery.
    """

    inscribed_radius: float = 0.0
    check_footprint: bool = False
    max_turning_slope: float = 0.35

    def __init__(self, topology: MeshTopology, locator: SurfaceLocator) -> None:
        super().__init__()
        self._outlines: tuple[tuple[int, Corners], dict[float, OutlineOnGround]] | None = None
        self.topology, self.locator = topology, locator
        self.vertices = topology.vertices
        self.faces = topology.faces
        self.vertex_normals = topology.vertex_normals
        self.face_normals = topology.face_normals
        self.edges = topology.edges
        self.neighbour_offsets = topology.neighbour_offsets
        self.neighbours = topology.neighbours
        self.neighbour_lengths = topology.neighbour_lengths
        self.vertex_face_offsets = topology.vertex_face_offsets
        self.vertex_faces = topology.vertex_faces
        self.face_neighbours = topology.face_neighbours
        self.components = topology.components
        self.input_to_internal = topology.input_to_internal
        self.internal_to_input = topology.internal_to_input

    @abstractmethod
    def snapshot(self) -> MeshSnapshot:
        """Return the current state; cheap, call it once per plan or control cycle."""

    def to_input_order(self, values: NDArray[Any]) -> NDArray[Any]:
        """Bring per-vertex values (V, ...) into the caller's numbering, as float64; dropped vertices get NaN."""
        result = np.full((len(self.input_to_internal), *values.shape[1:]), np.nan, dtype=np.float64)
        kept = self.input_to_internal >= 0
        result[kept] = values[self.input_to_internal[kept]]
        return result

    def vertex_graph(self) -> networkx.Graph[int]:
        """Build the vertex graph for algorithms of your own, see ``vertex_graph.build_vertex_graph``."""
        from mbf_mesh_nav.mesh.vertex_graph import build_vertex_graph  # networkx takes 0.3 s to import

        snapshot = self.snapshot()
        return build_vertex_graph(self.topology, snapshot.costs, snapshot.edge_weights)

    def locate(self, points: ArrayLike, max_distance: float = np.inf) -> Location:
        """Nearest surface points of points (n, 3), at most ``max_distance`` away [m]; see ``SurfaceLocator.locate``."""
        return self.locator.locate(points, max_distance)

    def locate_one(self, point: ArrayLike, max_distance: float = np.inf, hint_face: int = -1) -> SurfacePoint | None:
        """Nearest surface point of a point (3,) [m], None if there is none; see ``SurfaceLocator.locate_one``."""
        return self.locator.locate_one(point, max_distance, hint_face)

    def places(self) -> MeshPlaces:
        """What can be asked of places, on the map as it is now."""
        return MeshPlaces(self.topology, self.locator, self.snapshot(), self.inscribed_radius)

    def point_check(self) -> PlaceCheck:
        """State and interpolated cost of the surface at points."""
        return self.places().check_point

    def first_outside(self, positions: FloatArray) -> int:
        """Index of the first of positions (n, 3) [m] that is past a border, -1 if none is.

        So is, the ends apart, one that is farther above or below the surface than places are.
        """
        location = self.locate(positions)
        outside = beyond_border(self.topology, positions, location)
        outside[1:-1] |= location.distances[1:-1] > OF_PLACES
        return int(np.argmax(outside)) if outside.any() else -1

    def first_line_outside(self, positions: FloatArray) -> int:
        """Index of the first of positions (n, 3) [m] whose line to the next leads past a border, at any height.

        Lines of up to one and a half edges of the mesh are not looked at: planners' paths have few others.
        """
        edge = self.topology.mean_edge_length
        places, lines = places_between(positions, edge / PLACES_AN_EDGE, LONG_LINE * edge)
        outside = beyond_border(self.topology, places, self.locate(places))
        return int(lines[np.argmax(outside)]) if outside.any() else -1

    def pose_check(self, query: PlaceQuery, *, center_only: bool = False) -> PlaceCheck:
        """State and summed cost below the robot's disc; LETHAL where its outline has to fit and does not."""
        places = self.places()
        return places.check_point if center_only else self._fitting(lambda pose: places.check_pose(pose, query), query)

    def path_check(self, query: PlaceQuery) -> PlaceCheck:
        """State of the ground below the robot's centre as planners look at it: LETHAL where it costs too much.

        It is LETHAL, too, where the outline has to fit and does not.
        """
        places = self.places()
        return self._fitting(lambda pose: places.check_on_path(pose, query.safety_dist), query)

    def plane_check(self, query: PlaceQuery, frame: Transform) -> PlaneCheck:
        """As ``pose_check`` and ``path_check`` say, for all poses in a few kernels."""
        fit, outline = self.places().fit_check(query), self.outline(query.safety_dist)
        if outline is None:
            return lambda poses: fit(in_plane(frame, poses))
        return outline.fit_check(fit, frame, self.locator)

    def outline(self, safety_dist: float = 0.0) -> OutlineOnGround | None:
        """The robot's outline, grown by ``safety_dist`` [m], on the map as it is now; None where a disc will do."""
        if not self.check_footprint:
            return None
        snapshot, kept = self.snapshot(), self._outlines
        asked = snapshot.version, self.footprint
        if kept is None or kept[0] != asked:
            kept = self._outlines = asked, {}
        if safety_dist not in kept[1]:
            corners = np.array(self.footprint)
            grown = corners + safety_dist * np.sign(corners)  # as costmap_2d pads footprints
            kept[1][safety_dist] = OutlineOnGround(self.topology, snapshot, grown)
        return kept[1][safety_dist]

    def _fitting(self, check: PlaceCheck, query: PlaceQuery) -> PlaceCheck:
        """A check that says LETHAL, too, where the outline has to fit and does not."""
        outline = self.outline(query.safety_dist)
        return check if outline is None else outline.pose_check(check, self.locator)

    def find_valid_pose(
        self, pose: Pose, dist_tolerance: float, angle_tolerance: float, query: PlaceQuery
    ) -> PoseAnswer:
        """Nearest pose where the robot fits with the heading of ``pose``; for a disc the angle does not matter."""
        return self.places().find_valid_pose(pose, dist_tolerance, query, self.pose_check(query))

    def obstacle_ahead(self, pose: Pose, command: Twist, duration: float) -> str:
        """Where the robot would come onto forbidden ground or past a border, or that it is too steep to turn.

        A motion that turns about a place within the robot's outline is a turn on the spot, even if it creeps.
        """
        return self._obstacle(pose, command, duration, FORBIDDEN_COST)

    def obstacle_on_track(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``, where only lethal ground is forbidden."""
        return self._obstacle(pose, command, duration, np.inf)

    def obstacle_on_path(self, pose: Pose, command: Twist, duration: float) -> str:
        """As ``obstacle_ahead``; its centre apart the robot may reach over a border and what costs too much."""
        return self._obstacle(pose, command, duration, FORBIDDEN_COST, may_overhang=True)

    def _obstacle(
        self, pose: Pose, command: Twist, duration: float, cost_limit: float, may_overhang: bool = False
    ) -> str:
        place = self.locate_one(pose.position, SURFACE_DISTANCE)
        if place is None:
            return f"the robot is more than {SURFACE_DISTANCE:g} m from the surface"
        turns = pivots(command, self.robot_reach)
        if turns and (slope := slope_at(self.topology, place)) > self.max_turning_slope:
            return f"the ground slopes {slope:.2f} rad, turning is allowed up to {self.max_turning_slope:g} rad"
        ranks = self.snapshot().traversability_rank(cost_limit)
        outline = self.outline()
        if outline is not None and (swept := outline.swept(place, pose, command, duration)):
            return swept
        if turns and self.footprint and not (outline is not None and may_overhang):
            motion = place, pose, command, duration, self.footprint
            if swept := swept_obstacle(self.topology, ranks, *motion, may_overhang=may_overhang):
                return swept
        locator = self.locator if may_overhang else None
        return forbidden_ahead(self.topology, ranks, place, pose, command, duration, self.disc_reach, locator)

    def contact_depth(self, pose: Pose) -> float:
        """How deep [m] the robot's disc lies in lethal ground, see ``mesh.contact``; 0 where its centre may stand."""
        place = self.locate_one(pose.position, SURFACE_DISTANCE)
        if place is None:
            return 0.0
        corners = self.faces[place.face]
        snapshot = self.snapshot()
        if not snapshot.traversability_rank(FORBIDDEN_COST, corners).any():
            return 0.0
        ranks = snapshot.traversability_rank(FORBIDDEN_COST)
        return contact_depth(self.topology, ranks, place, self.disc_reach)

    def nearest_obstacle(self, pose: Pose, within: float) -> tuple[float, float, float] | None:
        """Offset [m] to the nearest lethal vertex of the robot's storey; None if none is ``within`` [m]."""
        place = self.locate_one(pose.position, SURFACE_DISTANCE)
        if place is None:
            return None
        return nearest_of(self.topology, place, pose, within, self.snapshot().untouchable)

    def heights_below(self, points: FloatArray) -> FloatArray:
        """Height (n,) [m] of the first surface straight below each point (n, 3) [m], nan where there is none."""
        _, distances = self.locator.cast_rays(points, (0.0, 0.0, -1.0))
        return np.where(np.isfinite(distances), points[:, 2] - distances, np.nan)
