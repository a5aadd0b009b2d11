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

IntArray = NDArray[np.int64]

POINTS_PER_EDGE = 3
SLACK = 1.1
SEARCH_RADIUS = 1.0  # m around a place in which its face is looked for
FLOOR_CELL = 0.2  # m; width of the squares that a building's floor is made of


def geodesic_length(surface: Surface, places: Sequence[Sequence[float]], driven: float = math.inf) -> float:
    """Length [m] of the shortest path over a surface through places in their order, inf where there is none.

    Parameters
    ----------
    places : sequence of (3,) float
        On the surface, or up to a metre off it: then the nearest point counts.
    driven : float
        Length [m] of a path that leads through all of them; the shortest is looked for no farther afield, which
        changes nothing but the time it takes.
    """
    faces = surface.faces.astype(np.int64)
    if math.isfinite(driven):
        faces = faces[_within_reach(surface.vertices, faces, np.array(places, dtype=float).reshape(-1, 3), driven)]
    points, nodes_of_faces, starts, ends = _graph(surface.vertices, faces)
    own = len(points) + np.arange(len(places))
    for number, place in zip(own.tolist(), places, strict=True):
        face, _ = _nearest_face(surface.vertices[faces], np.asarray(place, dtype=float))
        if face < 0:
            return float("inf")
        starts = np.concatenate([starts, np.full(nodes_of_faces.shape[1], number)])
        ends = np.concatenate([ends, nodes_of_faces[face]])
    points = np.concatenate([points, np.array(places, dtype=float).reshape(-1, 3)])
    lengths = np.maximum(norm(points[starts] - points[ends]), 1e-12)  # 0 would mean no connection
    graph = coo_array((lengths, (starts, ends)), (len(points), len(points))).tocsr()
    legs = [dijkstra(graph, directed=False, indices=a)[b] for a, b in pairwise(own.tolist())]
    return float(np.sum(legs))


def _within_reach(vertices: FloatArray, faces: IntArray, places: FloatArray, driven: float) -> NDArray[np.bool_]:
    """Whether each face (F,) has a corner in reach of a leg: in the ellipsoid of paths that are not longer.

    A leg can be as long as what was driven without the other legs, which are straight at best. ``SLACK`` covers
    lengths that are measured from samples, and the error of the search; the longest edge, faces that stick out.
    """
    straight = norm(np.diff(places, axis=0))
    triangles = vertices[faces]
    longest = float(norm(triangles - np.roll(triangles, 1, axis=1)).max(initial=0.0))
    reached = np.zeros(len(vertices), dtype=bool)
    for start, end, length in zip(places[:-1], places[1:], straight, strict=True):
        reach = SLACK * max(driven - float(straight.sum() - length), float(length)) + 2.0 * longest
        reached |= norm(vertices - start) + norm(vertices - end) <= reach
    return np.asarray(reached[faces].any(axis=1))


def free_floor(grid: OccupancyGrid) -> Surface:
    """Free cells of a building's map as level squares of about 0.2 m at height 0; each is free only as a whole."""
    step = max(1, round(FLOOR_CELL / grid.resolution))
    ny, nx = (size // step for size in grid.free.shape)
    free = grid.free[: ny * step, : nx * step].reshape(ny, step, nx, step).all(axis=(1, 3))
    width = step * grid.resolution
    x, y = grid.origin_x + width * np.arange(nx + 1), grid.origin_y + width * np.arange(ny + 1)
    return height_grid(x, y, np.zeros((ny + 1, nx + 1)), free)


def _graph(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Nodes (N, 3), the nodes (F, 3 + 3 k) of every face, and both ends (M,) of every connection, each once."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, edge_of_side = np.unique(sides, axis=0, return_inverse=True)
    shares = np.arange(1, POINTS_PER_EDGE + 1) / (POINTS_PER_EDGE + 1)
    a, b = vertices[edges[:, 0], None], vertices[edges[:, 1], None]
    points = np.concatenate([vertices, (a + shares[:, None] * (b - a)).reshape(-1, 3)])
    on_edge = len(vertices) + np.arange(len(edges) * POINTS_PER_EDGE).reshape(len(edges), POINTS_PER_EDGE)
    chains = np.column_stack([edges[:, 0], on_edge, edges[:, 1]])
    connections = [(chains[:, k], chains[:, k + 1]) for k in range(POINTS_PER_EDGE + 1)]
    on_sides = on_edge[edge_of_side.reshape(-1, 3)]  # (F, 3, k); side s is opposite to corner s + 2
    for side in range(3):
        here, there, corner = on_sides[:, side], on_sides[:, (side + 1) % 3], faces[:, (side + 2) % 3]
        for k in range(POINTS_PER_EDGE):
            connections.append((here[:, k], corner))
            connections += [(here[:, k], there[:, other]) for other in range(POINTS_PER_EDGE)]
    starts, ends = (np.concatenate(column) for column in zip(*connections, strict=True))
    return points, np.column_stack([faces, on_sides.reshape(len(faces), -1)]), starts, ends


def _nearest_face(triangles: FloatArray, place: FloatArray) -> tuple[int, float]:
    """Index of the triangle (F, 3, 3) nearest to a place and the distance [m]; -1 if none is within a metre."""
    near = (triangles.min(axis=1) - SEARCH_RADIUS <= place) & (place <= triangles.max(axis=1) + SEARCH_RADIUS)
    candidates = np.flatnonzero(near.all(axis=1))
    if len(candidates) == 0:
        return -1, float("inf")
    nearest = closest_point(triangles[candidates], np.tile(place, (len(candidates), 1)))
    distances = norm(nearest - place)
    best = int(np.argmin(distances))
    return (int(candidates[best]), float(distances[best])) if distances[best] <= SEARCH_RADIUS else (-1, float("inf"))
