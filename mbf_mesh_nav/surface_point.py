"""Small questions about points on the surface: their corners, how far those are, whether the spot is blocked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.locate import SurfacePoint
from mbf_mesh_nav.mesh_map import MeshMap
from mbf_mesh_nav.snapshot import MeshSnapshot


def nearest_corner(mesh_map: MeshMap, point: SurfacePoint) -> int:
    """Return the corner of the point's face with the largest barycentric coordinate."""
    return int(mesh_map.faces[point.face, np.argmax(point.barycentric)])


def surface_point_at_vertex(mesh_map: MeshMap, vertex: int) -> SurfacePoint:
    """Return the surface point at a vertex, in one of its faces."""
    face = int(mesh_map.vertex_faces[mesh_map.vertex_face_offsets[vertex]])
    barycentric = (mesh_map.faces[face] == vertex).astype(np.float64)
    return SurfacePoint(face, barycentric, mesh_map.vertices[vertex].copy(), 0.0)


def corner_distances(
    mesh_map: MeshMap, blocked: NDArray[np.bool_], point: SurfacePoint
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Free corners of the point's face (k,) int32 and their straight distances (k,) float32 [m] to the point."""
    corners = mesh_map.faces[point.face]
    corners = np.ascontiguousarray(corners[~blocked[corners]])
    offsets = np.linalg.norm(mesh_map.vertices[corners] - point.point, axis=1).astype(np.float32)
    # A hair longer than the line, so that rounding cannot make it shorter than a straight-line bound.
    return corners, np.nextafter(offsets, np.float32(np.inf))


def describe_blockage(mesh_map: MeshMap, snapshot: MeshSnapshot, vertex: int, cost_limit: float) -> str:
    """Say why a vertex is blocked: its cost, the limit, and the layers that call it lethal."""
    names = [name for name, layer in mesh_map.layers.items() if layer.lethal[vertex]]
    layers = f" (lethal in layer {', '.join(names)})" if names else ""
    return f"cost {snapshot.costs[vertex]:.3g}, limit {cost_limit:g}{layers}"


def position_text(position: NDArray[np.float64] | tuple[float, float, float]) -> str:
    """Write a position for a message, in metres."""
    return f"({position[0]:.2f}, {position[1]:.2f}, {position[2]:.2f})"
