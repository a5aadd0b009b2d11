"""Small questions about points on the surface: their corners, how far those are, whether the spot is blocked."""

from __future__ import annotations

import math

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.map.snapshot import MeshSnapshot
from mbf_mesh_nav.mesh.locate import Location, SurfacePoint

ON_EDGE = 1e-9
INFINITELY_FAR = np.float32(np.inf)


def nearest_corner(mesh_map: MeshMap, point: SurfacePoint) -> int:
    """Return the corner of the point's face with the largest barycentric coordinate."""
    return int(mesh_map.faces[point.face, np.argmax(point.barycentric)])


def nearest_corners(mesh_map: MeshMap, spots: Location) -> IntArray:
    """As ``nearest_corner``, of many points that lie on the surface (n,)."""
    return np.asarray(mesh_map.faces[spots.faces, np.argmax(spots.barycentric, axis=1)])


def passes_blocked_corner(start: SurfacePoint, end: SurfacePoint, blocked: BoolArray) -> bool:
    """Whether the line between two points of one face comes nearer to a blocked corner (3,) than to the free ones.

    Neither point does itself. How much nearer is the lesser of two linear functions, so greatest where they are equal.
    """
    begin, change = start.barycentric, end.barycentric - start.barycentric
    for corner in np.flatnonzero(blocked).tolist():
        left, right = (corner + 1) % 3, (corner + 2) % 3
        rate = change[left] - change[right]
        share = min(max(float((begin[right] - begin[left]) / rate), 0.0), 1.0) if rate != 0.0 else 0.5
        there = begin + share * change
        if there[corner] > max(there[left], there[right]):
            return True
    return False


def surface_point_at_vertex(mesh_map: MeshMap, vertex: int) -> SurfacePoint:
    """Return the surface point at a vertex, in one of its faces."""
    face = int(mesh_map.vertex_faces[mesh_map.vertex_face_offsets[vertex]])
    barycentric = (mesh_map.faces[face] == vertex).astype(np.float64)
    return SurfacePoint(face, barycentric, mesh_map.vertices[vertex].copy(), 0.0)


def point_of_face(mesh_map: MeshMap, face: int, point: FloatArray) -> SurfacePoint:
    """Return the surface point at a place (3,) [m] in a face that is no wall; it is placed in the plan view."""
    corners = mesh_map.vertices[mesh_map.faces[face], :2].tolist()
    areas = []
    for index in range(3):
        (ax, ay), (bx, by) = corners[(index + 1) % 3], corners[(index + 2) % 3]
        areas.append((bx - ax) * (float(point[1]) - ay) - (by - ay) * (float(point[0]) - ax))
    return SurfacePoint(face, np.array(areas) / math.fsum(areas), point, 0.0)


def corner_distances(
    mesh_map: MeshMap, blocked: BoolArray, point: SurfacePoint, snapshot: MeshSnapshot | None = None
) -> tuple[IntArray, Float32Array]:
    """Free corners of the point's face (k,) int32 and how far the point is from them (k,) float32 [m].

    With a ``snapshot`` the straight lines are weighted like its edges, by the mean of the costs at both ends; corners
    of infinite cost do not count for the point's own. At a vertex that makes a line the edge.
    """
    face = mesh_map.faces[point.face].tolist()
    corners = [corner for corner in face if not blocked[corner]]
    place = point.point.tolist()
    lengths = [math.dist(mesh_map.vertices[corner].tolist(), place) for corner in corners]
    if snapshot is not None and snapshot.edge_cost_factor > 0.0:
        costs, factor = snapshot.costs, snapshot.edge_cost_factor
        at_point = _cost_at(point, [float(costs[corner]) for corner in face])
        lengths = [
            length * (1.0 + factor * 0.5 * (at_point + float(costs[corner])))
            for length, corner in zip(lengths, corners, strict=True)
        ]
    # Slightly longer than the line, so that rounding cannot make it shorter than a straight-line bound.
    return np.array(corners, dtype=np.int32), np.nextafter(np.array(lengths, dtype=np.float32), INFINITELY_FAR)


def _cost_at(point: SurfacePoint, corner_costs: list[float]) -> float:
    """Interpolate the cost at a point between the corners of its face that have a finite one."""
    mixed = known = 0.0
    for share, cost in zip(point.barycentric.tolist(), corner_costs, strict=True):
        if math.isfinite(cost):
            mixed += share * cost
            known += share
    return mixed / max(known, ON_EDGE)


def describe_blockage(mesh_map: MeshMap, snapshot: MeshSnapshot, vertex: int, cost_limit: float) -> str:
    """Why a vertex is blocked: the layers that make it lethal, not those that take it over from them, or its cost."""
    reasons = []
    for name, layer in mesh_map.layers.items():
        if layer.lethal[vertex] and not any(read.lethal[vertex] for read in layer.inputs):
            reason = layer.lethal_reason(vertex)
            reasons.append(f"{name} ({reason})" if reason else name)
    if reasons:
        return f"lethal in layer {', '.join(reasons)}"
    return f"cost {snapshot.costs[vertex]:.3g}, limit {cost_limit:g}"
