"""One leg of a plan, and the searches over the vertex graph that find it.

The arrays of a search are made here and relaxed in place by the kernels; a path found is converted to positions and
surface normals here as well, so a planner is only the choice of a kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.motion.path_poses import points_on_branch
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, propagate_distances
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import corner_distances
from mbf_mesh_nav.search.path_cost import cost_along

NO_TARGETS = np.zeros(0, dtype=np.int32)
NO_OFFSETS = np.zeros(0, dtype=np.float32)


@dataclass(frozen=True)
class LegQuery:
    """One search: from ``start`` to ``goal`` over the vertices that are not ``blocked`` (V,) bool.

    The poses behind the two points, and how far [rad] the last heading may be off, are for planners that look at
    headings.
    """

    start: SurfacePoint
    goal: SurfacePoint
    snapshot: MeshSnapshot
    blocked: BoolArray
    cancel_flag: FlagArray
    start_pose: Pose | None = None
    goal_pose: Pose | None = None
    angle_tolerance: float = 0.0


@dataclass(frozen=True)
class Leg:
    """A found leg: positions and surface normals (n, 3) from start to goal, its cost, what a controller may use.

    The note is for the user.
    """

    positions: FloatArray
    normals: FloatArray
    cost: float
    guidance: Any = None
    note: str = ""


def propagate_from(
    mesh_map: MeshMap,
    snapshot: MeshSnapshot,
    blocked: BoolArray,
    source: SurfacePoint,
    cancel_flag: FlagArray,
    target: SurfacePoint | None = None,
    guided: bool = False,
) -> tuple[Float32Array, IntArray, bool]:
    """Shortest distances over the vertex graph from a surface point.

    Parameters
    ----------
    target : SurfacePoint, optional
        Stop as soon as the path to it is known; without it the whole field is computed.
    guided : bool
        Whether the straight line to the target guides the search (A*).

    Returns
    -------
    distances : (V,) float32
        Weighted length [m], inf where not reached.
    predecessors : (V,) int32
        Previous vertex on the path from the source, -1 at its seeds and where not reached.
    finished : bool
        False if cancelled.
    """
    distances, predecessors, seeds = seeded_arrays(mesh_map, blocked, source, snapshot)
    targets, offsets = NO_TARGETS, NO_OFFSETS
    if target is not None:
        targets, offsets = corner_distances(mesh_map, blocked, target, snapshot)
    graph, step = search_graph(mesh_map, snapshot.edge_weights, blocked), threshold_step(mesh_map)
    search = graph, distances, predecessors, seeds
    if guided and target is not None:
        step, towards = mesh_map.topology.mean_edge_length, (mesh_map.vertices, target.point)
        finished = propagate_distances(*search, step, targets, offsets, cancel_flag, towards)
    else:
        finished = propagate_distances(*search, step, targets, offsets, cancel_flag)
    return distances, predecessors, finished


def search_graph(mesh_map: MeshMap, weights: Float32Array, blocked: BoolArray) -> SearchGraph:
    """The vertex graph with weights (2E,) [m] of its edges, for searches that never enter ``blocked`` (V,)."""
    return SearchGraph(mesh_map.neighbour_offsets, mesh_map.neighbours, weights, blocked)


def seeded_arrays(
    mesh_map: MeshMap, blocked: BoolArray, source: SurfacePoint, snapshot: MeshSnapshot | None = None
) -> tuple[Float32Array, IntArray, IntArray]:
    """Start state of a search from a surface point: distances (V,), predecessors (V,), seed vertices.

    A ``snapshot`` weighs the lines to the seeds, see ``corner_distances``.
    """
    vertex_count = len(mesh_map.vertices)
    distances = np.full(vertex_count, np.inf, dtype=np.float32)
    predecessors = np.full(vertex_count, -1, dtype=np.int32)
    seeds, offsets = corner_distances(mesh_map, blocked, source, snapshot)
    distances[seeds] = offsets
    return distances, predecessors, seeds


def threshold_step(mesh_map: MeshMap) -> float:
    """Step [m] of the work lists of ``propagate_distances``: four edges; with less the far list is scanned often."""
    return 4.0 * mesh_map.topology.mean_edge_length


def vertex_path_leg(
    mesh_map: MeshMap, query: LegQuery, distances: Float32Array, predecessors: IntArray, rooted_at_goal: bool = False
) -> Leg | None:
    """Leg along the predecessors of a search from ``query.start``, or from the goal; None without a path.

    Start and goal in one face are joined by the straight line within it.
    """
    start, goal = query.start, query.goal
    if start.face == goal.face:
        return straight_leg(mesh_map, query)
    corners, offsets = corner_distances(mesh_map, query.blocked, start if rooted_at_goal else goal, query.snapshot)
    total, best = min(zip((distances[corners] + offsets).tolist(), corners.tolist(), strict=True), default=(np.inf, -1))
    if total == np.inf:
        return None
    surface = mesh_map.vertices, mesh_map.vertex_normals
    positions, normals = points_on_branch(predecessors, best, *surface, not rooted_at_goal)
    positions[0], positions[-1] = start.point, goal.point
    normals[0], normals[-1] = mesh_map.face_normals[start.face], mesh_map.face_normals[goal.face]
    return Leg(positions, normals, total)


def straight_leg(mesh_map: MeshMap, query: LegQuery) -> Leg:
    """Join start and goal by a line; they lie in one face."""
    positions = np.array([query.start.point, query.goal.point])
    point_faces = np.array([query.start.face, query.goal.face], dtype=np.int32)
    cost = cost_along(mesh_map, query.snapshot, positions, point_faces)
    return Leg(positions, mesh_map.face_normals[point_faces], cost)
