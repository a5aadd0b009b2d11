"""Where on a tiled map a start or a goal is: its tile, its face, and the corners from which a search begins.

Only the faces around the place are looked at, as a small map of their own; the answers are those of the whole map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.mesh.bounding_boxes import build_boxes, closest_face
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.borders import on_surface
from mbf_mesh_nav.mesh.checked_mesh import CheckedMesh
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import corner_distances, nearest_corner
from mbf_mesh_nav.mesh.topology import build_topology
from mbf_mesh_nav.search.path_cost import cost_along
from mbf_mesh_nav.tiles.tile import Tile, TileKey
from mbf_mesh_nav.tiles.tile_graph import TileGraph

AS_NEAR = 1e-9
"""A face that is not farther [m] than the nearest one by more is as near: both have the place on their edge."""


@dataclass(frozen=True, eq=False)
class TilePlace:
    """A place on the core of a tile.

    Attributes
    ----------
    key : (int, int)
        The tile.
    face : int
        Core face of the tile.
    point : (3,) float64
        On the surface [m].
    distance : float
        From the position that was asked for [m].
    normal : (3,) float64
        Of the face.
    corners, corner_costs : (k,) int32, (k,) float32
        Free corners of the face, as core vertices of the tile, and the costs [m] of the lines to them.
    blocked_by : str
        Why the nearest corner is blocked; empty if it is free.
    neighbourhood, face_around, snapshot
        The faces around the place, which of them it lies on, and the costs of their corners.
    """

    key: TileKey
    face: int
    point: FloatArray
    distance: float
    normal: FloatArray
    corners: IntArray
    corner_costs: Float32Array
    blocked_by: str
    neighbourhood: MeshMap
    face_around: int
    snapshot: MeshSnapshot

    def cost_to(self, other: TilePlace) -> float:
        """Cost [m] of the line to another place in the same face."""
        line, faces = np.array([self.point, other.point]), np.full(2, self.face_around, dtype=np.int32)
        return cost_along(self.neighbourhood, self.snapshot, line, faces)


def find_place(key: TileKey, tile: Tile, seen: TileGraph, position: FloatArray, reach: float) -> TilePlace | None:
    """Place of a position (3,) [m] on a tile's core; None if it is farther than ``reach`` [m] or on another tile."""
    # 1. The faces around it, and those beside them: their borders are not borders of the map.
    touched = np.zeros(len(tile.vertices), dtype=np.bool_)
    touched[_within(tile.vertices, position, reach + seen.longest_edge)] = True
    if not touched[: tile.core_vertices].any():
        return None
    touched[tile.faces[_any_corner(touched, tile.faces)]] = True
    around, internal = _part_of(tile, np.flatnonzero(_any_corner(touched, tile.faces)).astype(np.int32))
    topology = around.topology
    # 2. The nearest of them has to be one of the core, or one of the core as near.
    point = on_surface(topology, around.locator, position, reach)
    if point is not None:
        point = _nearest_of_core(around, int(tile.core_faces[0]), position, point.distance + AS_NEAR)
    if point is None:
        return None
    # 3. What the tile knows of its corners.
    snapshot, blocked = _seen_at(seen, internal, internal < tile.core_vertices)
    costs, lethal = snapshot.costs, snapshot.lethal
    free, corner_costs = corner_distances(around, blocked, point, snapshot)
    nearest = nearest_corner(around, point)
    reason = f"cost {costs[nearest]:.3g}{' (lethal)' if lethal[nearest] else ''}" if blocked[nearest] else ""
    return TilePlace(
        key=key,
        face=int(topology.internal_to_input_faces[point.face]),
        point=point.point,
        distance=point.distance,
        normal=topology.face_normals[point.face],
        corners=internal[free].astype(np.int32),
        corner_costs=corner_costs,
        blocked_by=reason,
        neighbourhood=around,
        face_around=point.face,
        snapshot=snapshot,
    )


def _part_of(tile: Tile, chosen: IntArray) -> tuple[MeshMap, IntArray]:
    """Map of some faces of a tile, and which vertices of the tile its vertices are."""
    vertices, faces = np.unique(tile.faces[chosen], return_inverse=True)
    corners: IntArray = faces.reshape(-1, 3).astype(np.int32)
    own = np.arange(len(vertices), dtype=np.int32)
    topology = build_topology(CheckedMesh(tile.vertices[vertices], corners, own, chosen, own))
    return MeshMap(topology), vertices[topology.internal_to_input]


def _seen_at(seen: TileGraph, vertices: IntArray, is_core: BoolArray) -> tuple[MeshSnapshot, BoolArray]:
    """Costs of some vertices of a tile, and which are blocked (n,); all that do not belong to its core are."""
    costs = np.full(len(vertices), np.inf, dtype=np.float32)
    costs[is_core] = seen.snapshot.costs[vertices[is_core]]
    lethal, blocked = ~is_core, ~is_core
    lethal[is_core] = seen.snapshot.lethal[vertices[is_core]]
    blocked[is_core] = seen.graph.blocked[vertices[is_core]]
    no_edges = np.zeros(0, dtype=np.float32)
    return MeshSnapshot(0, costs, lethal, no_edges, seen.snapshot.edge_cost_factor), blocked


def _within(vertices: FloatArray, position: FloatArray, reach: float) -> IntArray:
    """Vertices in a cube around a position; axis by axis, as most are out of it along the first."""
    chosen = np.arange(len(vertices), dtype=np.int32)
    for axis in range(3):
        chosen = chosen[np.abs(vertices[chosen, axis] - position[axis]) <= reach]
    return chosen


def _any_corner(mask: BoolArray, faces: IntArray) -> BoolArray:
    """Faces (F,) with a corner in a mask (V,)."""
    return np.asarray(mask[faces[:, 0]] | mask[faces[:, 1]] | mask[faces[:, 2]])


def _nearest_of_core(around: MeshMap, core_faces: int, position: FloatArray, within: float) -> SurfacePoint | None:
    """Nearest point on the core's faces of a neighbourhood, None beyond ``within`` [m]."""
    of_core = np.flatnonzero(around.topology.internal_to_input_faces < core_faces)
    faces = around.faces[of_core]
    faces.flags.writeable = False  # as those of a map: kernels know one type
    boxes, levels = build_boxes(around.vertices, faces)
    x, y, z = position.tolist()
    face, distance, v, w, px, py, pz = closest_face(around.vertices, faces, boxes, levels, x, y, z, within, -1)
    if face < 0:
        return None
    return SurfacePoint(int(of_core[face]), np.array([1.0 - v - w, v, w]), np.array([px, py, pz]), distance)
