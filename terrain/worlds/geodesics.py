"""Length of the shortest path over a surface, to compare driven paths with; independent of costs, robot and planner.

Use it for tables: path length / shortest length is the detour that a planner made. It is an upper bound of
the geodesic distance, at most 3 % above it: Dijkstra's search over corners and ``POINTS_PER_EDGE`` points on every edge
(M. Lanthier, A. Maheshwari, J.-R. Sack, Approximating weighted shortest paths on polyhedral surfaces, 1997), joined
across every face. It takes about 10 microseconds per face; planners of ``mbf_mesh_nav`` are faster.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from trimesh.triangles import closest_point

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm
from terrain.worlds.occupancy import OccupancyGrid
from terrain.worlds.surface import Surface, height_grid

IntArray = NDArray[np.int32]  # half the memory of int64, and memory is most of the time

POINTS_PER_EDGE = 3
DETOUR = 1.05  # of the first search; most shortest paths over open ground are found in it
SEARCH_RADIUS = 1.0  # m around a place in which its face is looked for
FLOOR_CELL = 0.2  # m; width of the squares that a building's floor is made of


def _connections_of_face() -> IntArray:
    """Which nodes of a face are joined, (2, M): points of a side with the corner opposite and with the next side.

    A face has its three corners first, then the points of each side; side s lies between corners s and s + 1.
    """
    side = [3 + s * POINTS_PER_EDGE + np.arange(POINTS_PER_EDGE) for s in range(3)]
    joined = [(one, other) for s in range(3) for one in side[s] for other in ((s + 2) % 3, *side[(s + 1) % 3])]
    return np.array(joined, dtype=np.int32).T


CONNECTIONS = _connections_of_face()


def geodesic_length(surface: Surface, places: Sequence[Sequence[float]], driven: float = math.inf) -> float:
    """Length [m] of the shortest path over a surface through places in their order, inf where there is none.

    Parameters
    ----------
    places : sequence of (3,) float
        On the surface, or up to a metre off it: then the nearest point counts.
    driven : float
        Length [m] of a path that leads through all of them, where to look if nearly straight ones do not do. It
        changes nothing but the time it takes.
    """
    stops, faces = np.array(places, dtype=float).reshape(-1, 3), surface.faces.astype(np.int32)
    straight = norm(np.diff(stops, axis=0))
    as_driven = driven - float(straight.sum()) + straight  # m; the other legs are straight at best
    reaches = DETOUR * straight
    while True:
        legs = _search(surface.vertices, faces, stops, reaches)
        is_shortest = (legs <= reaches) | np.isinf(reaches)  # nothing shorter leads through what was left out
        if is_shortest.all():
            return float(np.sum(legs))
        wider = np.where(np.isfinite(legs), legs, np.where(reaches < as_driven, as_driven, math.inf))
        reaches = np.where(is_shortest, reaches, wider)


def _search(vertices: FloatArray, faces: IntArray, stops: FloatArray, reaches: FloatArray) -> FloatArray:
    """Length [m] (K - 1,) of the shortest path of each leg between stops (K, 3), over the faces in its reach."""
    faces = faces[_within_reach(vertices, faces, stops, reaches)]
    near = [_nearest_face(vertices[faces], stop) for stop in stops]
    if min(near, default=-1) < 0:
        return np.full(len(reaches), math.inf)
    points, nodes, connections = _graph(vertices, faces)
    own, around = len(points) + np.arange(len(stops), dtype=np.int32), nodes[:, near]  # around: (nodes of a face, K)
    connections.append((np.broadcast_to(own, around.shape), around, norm(points[around] - stops)))
    starts, ends, lengths = (
        np.concatenate([part.ravel() for part in column]) for column in zip(*connections, strict=True)
    )
    size = len(points) + len(stops)
    graph = coo_array((np.maximum(lengths, 1e-12), (starts, ends)), (size, size)).tocsr()  # 0 would mean no connection
    return np.array([dijkstra(graph, directed=False, indices=a)[b] for a, b in pairwise(own.tolist())])


def _within_reach(vertices: FloatArray, faces: IntArray, stops: FloatArray, reaches: FloatArray) -> NDArray[np.bool_]:
    """Whether each face (F,) can be touched by a leg: by paths not longer than its reach, which fill an ellipsoid.

    The longest edge is added for faces that stick out of it; faces around the stops belong to it in any case.
    """
    triangles = vertices[faces]
    longest = float(norm(triangles - np.roll(triangles, 1, axis=1)).max(initial=0.0))
    away = [norm(vertices - stop) for stop in stops]
    reached = np.minimum.reduce(away) <= SEARCH_RADIUS + longest
    for start, end, reach in zip(away[:-1], away[1:], reaches.tolist(), strict=True):
        reached |= start + end <= reach + 2.0 * longest
    return np.asarray(reached[faces].any(axis=1))


def _graph(
    vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray, list[tuple[IntArray, IntArray, FloatArray]]]:
    """Nodes (N, 3), which of them each face has (3 + 3 k, F), and parts of all connections: both ends and lengths."""
    corners, size = faces.astype(np.int64), len(vertices)
    others = np.roll(corners, -1, axis=1)
    codes, edge_of_side = np.unique(
        np.minimum(corners, others) * size + np.maximum(corners, others), return_inverse=True
    )
    edges = np.stack(np.divmod(codes, size)).astype(np.int32)
    shares = np.arange(1, POINTS_PER_EDGE + 1)[:, None, None] / (POINTS_PER_EDGE + 1)
    a, b = vertices[edges]
    points = np.concatenate([vertices, (a + shares * (b - a)).reshape(-1, 3)])
    on_edges = size + np.arange(POINTS_PER_EDGE * len(codes), dtype=np.int32).reshape(POINTS_PER_EDGE, -1)
    chains = np.concatenate([edges[:1], on_edges, edges[1:]])
    on_sides = on_edges[:, edge_of_side.reshape(-1, 3)]  # (k, F, 3)
    nodes = np.concatenate([faces.T, on_sides.transpose(2, 0, 1).reshape(-1, len(faces))])
    places = points[nodes]
    across = [(nodes[i], nodes[j], norm(places[i] - places[j])) for i, j in CONNECTIONS.T.tolist()]
    return points, nodes, [*across, (chains[:-1], chains[1:], norm(np.diff(points[chains], axis=0)))]


def _nearest_face(triangles: FloatArray, place: FloatArray) -> int:
    """Index of the triangle (F, 3, 3) nearest to a place, -1 if none is within a metre."""
    near = (triangles.min(axis=1) - SEARCH_RADIUS <= place) & (place <= triangles.max(axis=1) + SEARCH_RADIUS)
    candidates = np.flatnonzero(near.all(axis=1))
    if len(candidates) == 0:
        return -1
    nearest = closest_point(triangles[candidates], np.tile(place, (len(candidates), 1)))
    distances = norm(nearest - place)
    best = int(np.argmin(distances))
    return int(candidates[best]) if distances[best] <= SEARCH_RADIUS else -1


def free_floor(grid: OccupancyGrid) -> Surface:
    """Free cells of a building's map as level squares of about 0.2 m at height 0; each is free only as a whole."""
    step = max(1, round(FLOOR_CELL / grid.resolution))
    ny, nx = (size // step for size in grid.free.shape)
    free = grid.free[: ny * step, : nx * step].reshape(ny, step, nx, step).all(axis=(1, 3))
    width = step * grid.resolution
    x, y = grid.origin_x + width * np.arange(nx + 1), grid.origin_y + width * np.arange(ny + 1)
    return height_grid(x, y, np.zeros((ny + 1, nx + 1)), free)
