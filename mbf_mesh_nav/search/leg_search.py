"""One leg of a plan, and the searches over the vertex graph that find it.

The arrays of a search are made here and relaxed in place by the kernels; a path found is converted to positions and
surface normals here as well, so a planner is only the choice of a kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbf_abstract.geometry import Path, Pose
from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.motion.path_poses import points_on_branch, poses_along
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, propagate_distances
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import corner_distances
from mbf_mesh_nav.search.path_cost import cost_along

SAME_POINT = 1e-6
"""Points of a path so near [m] to each other are one."""
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


def joined(first: Leg, second: Leg) -> Leg:
    """One leg of two, the second of which begins where the first one ends."""
    positions = np.concatenate([first.positions, second.positions[1:]])
    normals = np.concatenate([first.normals, second.normals[1:]])
    return Leg(positions, normals, first.cost + second.cost, None, first.note or second.note)


def points_at(positions: FloatArray, lengths: FloatArray, at: FloatArray) -> FloatArray:
    """Points (k, 3) [m] at lengths (k,) along a line through positions with ``lengths`` (n,) [m], or its ends."""
    return np.column_stack([np.interp(at, lengths, positions[:, axis]) for axis in range(3)])


def path_of_legs(legs: Sequence[Leg], goal: Pose, ends_there: bool, frame_id: str, stamp: float) -> Path:
    """One path of all legs; every pose looks to the next one and stands on the surface, the last one looks as ``goal``.

    It ends at the position of ``goal``, too, if it ``ends_there``.
    """
    positions = np.concatenate([legs[0].positions[:1]] + [leg.positions[1:] for leg in legs])
    normals = np.concatenate([legs[0].normals[:1]] + [leg.normals[1:] for leg in legs])
    if ends_there:
        positions[-1] = goal.position
    positions, orientations, sound = poses_along(positions, normals, SAME_POINT)
    orientations[-1] = goal.orientation
    guidance = tuple(leg.guidance for leg in legs if leg.guidance is not None) or None
    path = Path.of_checked_arrays if sound else Path
    return path(positions, orientations, frame_id, stamp, guidance)


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
