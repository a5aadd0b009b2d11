"""String pulling: take the corners and zigzags of a mesh's edges out of a path, without raising its cost.

When to use: behind planners on the vertex graph (``mesh.astar``, ``mesh.dijkstra``, ``mesh.repairing``), whose paths
follow edges. When not: behind ``mesh.any_angle`` and ``mesh.cvp``, whose paths are smooth already, and behind
``mesh.heading_astar``, for a pulled path keeps no limits of headings.

Start and goal stay. Each piece of the path is replaced by the geodesic near it, or by the shortest path through its
own faces, or its two halves are, whichever has the least cost: length plus the map's costs integrated along it. So the
result never costs more than the path given. No new face has a blocked corner, nor does the robot touch anything where
it touched nothing near there on the path given, nor its outline where the map checks it; where the path leads along
edges between blocked faces it stays. A path that drives backward somewhere is handed back unchanged; one that leaves
the map between its poses is a MAP_ERROR.

Formula: the funnel algorithm (Lee and Preparata 1984) in a corridor of faces that is turned round the vertices where
that makes it shorter (Xin and Wang 2007), see ``kernels.wave.corridors``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.maps.refiners.map_refiner import MapRefiner
from mbf_abstract.outcomes import RefinePathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import RefineResult
from mbf_abstract.time.cancel import CancelToken
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.kernels.motion.path_poses import poses_along
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.plugins import MeshRefiner
from mbf_mesh_nav.search.corridor import Corridor, Piece
from mbf_mesh_nav.search.fitting.misfits import new_misfits
from mbf_mesh_nav.search.fitting.outline_check import PADDING
from mbf_mesh_nav.search.leg_search import SAME_POINT
from mbf_mesh_nav.search.touched_places import TouchedPlaces

FLAT = 1e-6
"""m; lines between poses that are no farther from the surface lie on it."""
GAP = 0.01
"""m; a line farther from the surface does not lie on it, whatever the rounding."""
ATTEMPTS = 6
"""How often the path is pulled, each time past more faces in which the robot would touch something."""
POINTS_AN_EDGE = 2.0
"""Points put onto the surface per mean edge of the mesh where the poses of a path are farther apart."""


class StringPullingParameters(PluginParameters):
    """Parameters of ``mesh.string_pulling``."""

    cost_limit: float = parameter(1.0, "Vertices whose cost reaches this are impassable.", gt=0.0, allow_inf=True)
    max_surface_distance: float = parameter(
        0.4, "A pose farther than this from the surface is out of the map.", unit="m", gt=0.0
    )
    max_passes: int = parameter(4, "Go over the path at most so many times.", ge=1, le=100)
    least_gain: float = parameter(
        0.001, "Stop when a pass lowers the cost by a smaller share than this.", ge=0.0, lt=1.0
    )


class StringPullingRefiner(MeshRefiner, MapRefiner):
    """Cost-aware shortening of a path over the surface."""

    Parameters: ClassVar[type[PluginParameters]] = StringPullingParameters
    parameters: StringPullingParameters

    def refine(self, path: Path, cancel_token: CancelToken) -> Path | RefineResult:
        """Pull the path straight between its ends."""
        snapshot = self.mesh_map.snapshot()
        blocked = snapshot.blocked(self.parameters.cost_limit)
        piece = self._on_surface(Corridor(self.mesh_map, snapshot, blocked), path.positions)
        if isinstance(piece, RefineResult):
            return piece
        touched, outline = TouchedPlaces(self.mesh_map, snapshot), self.mesh_map.outline(PADDING)
        for _ in range(ATTEMPTS):
            pulled = self._pulled(Corridor(self.mesh_map, snapshot, blocked), piece, cancel_token)
            new_faces = touched.new_faces(pulled, piece)
            if outline is not None and not len(new_faces):
                new_faces = new_misfits(self.mesh_map, outline, pulled[0], piece[0])
            if not len(new_faces) or cancel_token.cancelled:
                return self._with_poses(path, pulled)
            blocked[self.mesh_map.faces[new_faces]] = True
        place = position_text(self.mesh_map.vertices[self.mesh_map.faces[new_faces[0], 0]])
        text = f"shortened, the path would make the robot touch something near {place}, and is left as it is"
        return RefineResult(RefinePathOutcome.SUCCESS, text, path)

    def _on_surface(self, corridor: Corridor, positions: FloatArray) -> Piece | RefineResult:
        """The path as points and the faces its segments lie in, or what is off the surface."""
        reach = self.parameters.max_surface_distance
        poses = self.mesh_map.locate(positions, reach)
        off = np.flatnonzero(poses.faces < 0)
        if len(off):
            text = f"pose {off[0]} of the path, {position_text(positions[off[0]])}, is more than {reach:g} m"
            return RefineResult(RefinePathOutcome.MAP_ERROR, f"{text} from the surface")
        points = _filled(poses.points, self.mesh_map.topology.mean_edge_length / POINTS_AN_EDGE)
        spots, middles = self.mesh_map.locate(points), self.mesh_map.locate(0.5 * (points[1:] + points[:-1]))
        # Both ends twice: their own faces are the first and the last, whatever face the segments beside them lie in.
        ends = [0, *range(len(points)), len(points) - 1]
        if max(spots.distances.max(), middles.distances.max()) <= FLAT:
            faces = np.concatenate([spots.faces[:1], spots.faces[:1], middles.faces, spots.faces[-1:]])
            return spots.points[ends], faces
        # Poses too far apart for the surface between them: the string through the faces below the lines between them.
        piece = corridor.string(spots.points[ends], spots.faces[ends])
        gaps = self.mesh_map.locate(0.5 * (piece[0][1:] + piece[0][:-1])).distances > GAP
        if gaps.any():
            text = f"the path leaves the surface after {position_text(piece[0][np.argmax(gaps)])}"
            return RefineResult(RefinePathOutcome.MAP_ERROR, text)
        return piece

    def _pulled(self, corridor: Corridor, piece: Piece, cancel_token: CancelToken) -> Piece:
        """Passes until one gains too little; each cuts the path elsewhere, so that no cut leaves a corner."""
        cost = corridor.cost(*piece)
        for _ in range(self.parameters.max_passes):
            pulled = corridor.cheapest(*piece, cancel_token.flag)
            new_cost = corridor.cost(*pulled)
            if cancel_token.cancelled or new_cost >= cost:
                break
            gain, piece, cost = 1.0 - new_cost / cost, pulled, new_cost
            if gain < self.parameters.least_gain:
                break
        return piece

    def _with_poses(self, path: Path, pulled: Piece) -> Path:
        """Poses that look along the pulled points and stand on their faces; the last one stays as it is."""
        positions, faces = pulled[0].copy(), pulled[1]
        positions[[0, -1]] = path.positions[[0, -1]]
        positions, orientations, _ = poses_along(positions, self.mesh_map.face_normals[faces], SAME_POINT)
        if path.orientations is not None:
            orientations[-1] = path.orientations[-1]
        return Path(positions, orientations, path.frame_id, path.stamp, path.guidance)


def _filled(positions: FloatArray, spacing: float) -> FloatArray:
    """The positions (n, 3) and points on the lines between them, none farther than ``spacing`` [m] from the next."""
    counts = np.maximum(np.ceil(np.diff(polyline_lengths(positions)) / spacing - 1e-9), 1.0).astype(np.int64)
    starts = np.repeat(np.arange(len(counts)), counts)
    shares = (np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[starts]
    filled = positions[starts] + shares[:, None] * (positions[starts + 1] - positions[starts])
    return np.concatenate([filled, positions[-1:]])
