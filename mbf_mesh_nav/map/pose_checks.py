"""What a point, a pose or a path on a mesh costs, and where a round robot fits.

The robot is a disc of its inscribed radius, grown by the safety distance, lying on the surface; its part of the map
are the vertices below it that are connected to the place it stands on, so the storeys above and below do not count.

- OUTSIDE: no surface within ``SURFACE_DISTANCE`` above or below the position, or past a border.
- LETHAL: the disc (of a point: the nearest vertex) touches a lethal vertex or one whose cost is infinite or NaN.
- INSCRIBED: of a point only: a robot standing there would touch one.

Deviation from the costmap's answers: a disc has no heading, hence ``angle_tolerance`` never matters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.arithmetic import norm, scalar_products
from mbf_abstract.maps.queries import CellState, PathAnswer, PlaceAnswer, PlaceQuery, PoseAnswer
from mbf_mesh_nav.kernels.mesh.surface_disc import vertices_in_disc
from mbf_mesh_nav.map.layer import IntArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import on_surface

SURFACE_DISTANCE = 0.5
"""How far [m] a position may be off the surface to count as on it; less than a storey, more than a wheel."""

OUTSIDE = PlaceAnswer(CellState.OUTSIDE, 0.0)


def check_point(mesh_map: MeshMap, point: Pose) -> PlaceAnswer:
    """State and interpolated cost of the surface at a point."""
    place = on_surface(mesh_map, point.position, SURFACE_DISTANCE)
    if place is None:
        return OUTSIDE
    snapshot = mesh_map.snapshot()
    nearest = _nearest_vertex(mesh_map, place)
    weights = place.barycentric > 1e-12
    cost = float(scalar_products(place.barycentric[weights], snapshot.costs[mesh_map.faces[place.face][weights]]))
    if _blocked(snapshot, np.array([nearest])).any():
        return PlaceAnswer(CellState.LETHAL, cost)
    touched = _blocked(snapshot, _disc(mesh_map, place, mesh_map.inscribed_radius)).any()
    return PlaceAnswer(CellState.INSCRIBED if touched else CellState.FREE, cost)


def check_pose(mesh_map: MeshMap, pose: Pose, query: PlaceQuery) -> PlaceAnswer:
    """State of the robot's disc at a pose and the sum of the costs of the vertices below it."""
    place = on_surface(mesh_map, pose.position, SURFACE_DISTANCE)
    if place is None:
        return OUTSIDE
    snapshot = mesh_map.snapshot()
    vertices = _disc(mesh_map, place, mesh_map.inscribed_radius + query.safety_dist)
    blocked = _blocked(snapshot, vertices)
    costs = np.where(blocked, snapshot.costs[vertices] * query.lethal_cost_mult, snapshot.costs[vertices])
    return PlaceAnswer(CellState.LETHAL if blocked.any() else CellState.FREE, float(costs.sum()))


def check_path(
    mesh_map: MeshMap,
    path: Path,
    query: PlaceQuery,
    return_on: CellState | None = None,
    skip_poses: int = 0,
    path_cells_only: bool = False,
) -> PathAnswer:
    """Worst state and summed cost over every ``skip_poses + 1``-th pose; ends at a state of at least ``return_on``.

    Raises
    ------
    ValueError
        ``skip_poses`` is negative.
    """
    if skip_poses < 0:
        raise ValueError(f"skip_poses must not be negative, got {skip_poses}")
    state, cost, index = CellState.FREE, 0.0, -1
    for index in range(0, len(path), skip_poses + 1):
        answer = check_point(mesh_map, path[index]) if path_cells_only else check_pose(mesh_map, path[index], query)
        state, cost = max(state, answer.state), cost + answer.cost
        if return_on and state >= return_on:
            break
    return PathAnswer(index, state, cost)


def find_valid_pose(mesh_map: MeshMap, pose: Pose, dist_tolerance: float, query: PlaceQuery) -> PoseAnswer:
    """Nearest pose within ``dist_tolerance`` [m] where the disc fits: the pose itself, else a vertex near it.

    Near a pose on the surface only vertices of the same storey count; a tolerance of inf means anywhere on it.

    Raises
    ------
    ValueError
        The tolerance is negative or no number.
    """
    if not dist_tolerance >= 0.0:
        raise ValueError(f"dist_tolerance must not be negative, got {dist_tolerance}")
    first = check_pose(mesh_map, pose, query)
    if first.state < CellState.LETHAL:
        return PoseAnswer(first.state, first.cost, pose)
    place = on_surface(mesh_map, pose.position, SURFACE_DISTANCE)
    everywhere = np.arange(len(mesh_map.vertices), dtype=np.int32)
    near = everywhere if place is None else _disc(mesh_map, place, dist_tolerance)
    near = near[~_blocked(mesh_map.snapshot(), near)]
    distances = norm(mesh_map.vertices[near] - np.array(pose.position))
    order = np.argsort(distances, kind="stable")
    for vertex in near[order[distances[order] <= dist_tolerance]]:
        x, y, z = mesh_map.vertices[vertex].tolist()
        there = replace(pose, position=(x, y, z))
        answer = check_pose(mesh_map, there, query)
        if answer.state < CellState.LETHAL:
            return PoseAnswer(answer.state, answer.cost, there)
    return PoseAnswer(first.state, first.cost, None)


def _nearest_vertex(mesh_map: MeshMap, place: SurfacePoint) -> int:
    return int(mesh_map.faces[place.face][np.argmax(place.barycentric)])


def _disc(mesh_map: MeshMap, place: SurfacePoint, radius: float) -> IntArray:
    graph = (mesh_map.vertices, mesh_map.neighbour_offsets, mesh_map.neighbours)
    return vertices_in_disc(*graph, _nearest_vertex(mesh_map, place), place.point, float(radius))


def _blocked(snapshot: MeshSnapshot, vertices: IntArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.asarray(snapshot.lethal[vertices] | ~np.isfinite(snapshot.costs[vertices]))
