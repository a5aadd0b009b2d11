"""Exact descent of a distance field: the path is traced from edge to edge, never stepped and searched for.

Within a face the field is taken as linear, so the way down is a straight line to an edge. Crossing an edge it goes on
in the next face, in a valley it follows the edge, at a vertex it takes the steepest face or edge. The field falls
strictly from crossing to crossing, so the trace ends at the source; where rounding makes the field stall, the wave's
predecessors, which are acyclic, take over. Thus every reached point gets a path.

Vectors of three go through ``_difference`` and ``_dot``: array expressions would take numba seconds to compile.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel
from mbf_mesh_nav.kernels.dijkstra import Float32Array, Int32Array

Float64Array = NDArray[np.float64]

_ON_VERTEX = 1e-6  # a crossing this near (as a share of the edge) to a vertex is the vertex


@kernel
def trace_descent(
    vertices: Float64Array,
    faces: Int32Array,
    face_neighbours: Int32Array,
    vertex_face_offsets: Int32Array,
    vertex_faces: Int32Array,
    distances: Float32Array,
    predecessors: Int32Array,
    start_face: int,
    start: Float64Array,
    goal_face: int,
    goal: Float64Array,
    max_crossings: int,
) -> tuple[Float64Array, Int32Array]:
    """Trace the way down from ``start`` to the source of the field at ``goal``.

    Parameters
    ----------
    vertices, faces, face_neighbours, vertex_face_offsets, vertex_faces
        The mesh; (V, 3) float64 [m], (F, 3), (F, 3), (V+1,), (3F,) int32.
    distances, predecessors : (V,) float32 [m], (V,) int32
        The wave's result; at least one corner of ``start_face`` is reached.
    start_face, goal_face : int
        Different faces.
    start, goal : (3,) float64
        Points in them [m].
    max_crossings : int
        After that many edges only predecessors are followed.

    Returns
    -------
    points : (n, 3) float64
        From start to goal, one point per crossed edge or visited vertex [m].
    point_faces : (n,) int32
        The face the way to each point lies in (or on an edge of); the start's own face first.
    """
    capacity = 256
    points = np.empty((capacity, 3))
    point_faces = np.empty(capacity, dtype=np.int32)
    points[0], point_faces[0] = start, start_face
    count = 1
    face, vertex = start_face, -1
    point = start.copy()
    if not _is_reached(faces[face], distances):
        vertex = _best_corner(vertices, faces[face], distances, point)
    while True:
        # 1. In the goal's face, or at one of its corners, the rest is a straight line.
        if (vertex < 0 and face == goal_face) or (vertex >= 0 and _has_corner(faces[goal_face], vertex)):
            if vertex >= 0:
                points[count], point_faces[count] = vertices[vertex], face
                count += 1
            points[count], point_faces[count] = goal, goal_face
            return points[: count + 1].copy(), point_faces[: count + 1].copy()
        if count + 3 > capacity:
            capacity *= 2
            points = _grown(points, capacity)
            longer = np.empty(capacity, dtype=np.int32)
            longer[:count] = point_faces[:count]
            point_faces = longer
        # 2. At a vertex: note it, then choose the steepest way on.
        if vertex >= 0:
            point = vertices[vertex].copy()
            points[count], point_faces[count] = point, face
            count += 1
            if count > max_crossings:
                face, vertex = vertex_faces[vertex_face_offsets[vertex]], predecessors[vertex]
                continue
            face, vertex = _steepest_way(
                vertices, faces, vertex_face_offsets, vertex_faces, distances, predecessors, vertex
            )
            if vertex >= 0:
                continue
        # 3. Straight down through the face to the edge opposite to corner `exit_corner`.
        corners = faces[face]
        point, exit_corner, share = _leave_face(vertices, corners, distances, point)
        left, right = corners[(exit_corner + 1) % 3], corners[(exit_corner + 2) % 3]
        if share < _ON_VERTEX or share > 1.0 - _ON_VERTEX or count > max_crossings:
            vertex = left if share < 0.5 else right
            continue
        points[count], point_faces[count] = point, face
        count += 1
        # 4. Go on in the next face, or along the edge where the next face rises.
        following = face_neighbours[face, (exit_corner + 1) % 3]
        if following >= 0 and _leads_away_from_edge(vertices, faces[following], distances, left, right):
            face = following
        else:
            vertex = left if distances[left] < distances[right] else right


@kernel
def _is_reached(corners: Int32Array, distances: Float32Array) -> bool:
    return bool(distances[corners[0]] < np.inf and distances[corners[1]] < np.inf and distances[corners[2]] < np.inf)


@kernel
def _has_corner(corners: Int32Array, vertex: int) -> bool:
    return bool(corners[0] == vertex or corners[1] == vertex or corners[2] == vertex)


@kernel
def _grown(points: Float64Array, capacity: int) -> Float64Array:
    longer = np.empty((capacity, 3))
    longer[: len(points)] = points
    return longer


@kernel
def _difference(a: Float64Array, b: Float64Array) -> Float64Array:
    result = np.empty(3)
    for axis in range(3):
        result[axis] = a[axis] - b[axis]
    return result


@kernel
def _dot(a: Float64Array, b: Float64Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]  # type: ignore[no-any-return]


@kernel
def _best_corner(vertices: Float64Array, corners: Int32Array, distances: Float32Array, point: Float64Array) -> int:
    """Return the corner over which the way from ``point`` is shortest."""
    best, best_total = corners[0], np.inf
    for corner in corners:
        way = _difference(vertices[corner], point)
        total = distances[corner] + math.sqrt(_dot(way, way))
        if total < best_total:
            best, best_total = corner, total
    return int(best)


@kernel
def _descent_direction(vertices: Float64Array, corners: Int32Array, distances: Float32Array) -> Float64Array:
    """Negative gradient (3,) of the linear field on a face; its length is the slope of the field."""
    origin = vertices[corners[0]]
    e1, e2 = _difference(vertices[corners[1]], origin), _difference(vertices[corners[2]], origin)
    d1 = float(distances[corners[1]]) - float(distances[corners[0]])
    d2 = float(distances[corners[2]]) - float(distances[corners[0]])
    g11, g12, g22 = _dot(e1, e1), _dot(e1, e2), _dot(e2, e2)
    determinant = max(g11 * g22 - g12 * g12, 1e-300)
    descent = np.empty(3)
    for axis in range(3):
        descent[axis] = -((d1 * g22 - d2 * g12) * e1[axis] + (d2 * g11 - d1 * g12) * e2[axis]) / determinant
    return descent


@kernel
def _barycentric_rates(vertices: Float64Array, corners: Int32Array, direction: Float64Array) -> Float64Array:
    """Change (3,) of the barycentric coordinates per unit of a direction in the face's plane."""
    origin = vertices[corners[0]]
    e1, e2 = _difference(vertices[corners[1]], origin), _difference(vertices[corners[2]], origin)
    g11, g12, g22 = _dot(e1, e1), _dot(e1, e2), _dot(e2, e2)
    determinant = max(g11 * g22 - g12 * g12, 1e-300)
    p1, p2 = _dot(direction, e1), _dot(direction, e2)
    rates = np.empty(3)
    rates[1] = (p1 * g22 - p2 * g12) / determinant
    rates[2] = (p2 * g11 - p1 * g12) / determinant
    rates[0] = -rates[1] - rates[2]
    return rates


@kernel
def _leave_face(
    vertices: Float64Array, corners: Int32Array, distances: Float32Array, point: Float64Array
) -> tuple[Float64Array, int, float]:
    """Follow the descent through a face; the exit point, the corner opposite to its edge, its share of the edge.

    The share counts from the corner after the opposite one (counter-clockwise).
    """
    rates = _barycentric_rates(vertices, corners, _descent_direction(vertices, corners, distances))
    weights = _barycentric_rates(vertices, corners, _difference(point, vertices[corners[0]]))
    weights[0] += 1.0
    exit_corner, shortest = 0, np.inf
    for corner in range(1, 3):
        exit_corner = corner if rates[corner] < rates[exit_corner] else exit_corner
    for corner in range(3):
        # A coordinate at zero belongs to the edge the way came in by.
        if rates[corner] < 0.0 and weights[corner] > 1e-9 and -weights[corner] / rates[corner] < shortest:
            exit_corner, shortest = corner, -weights[corner] / rates[corner]
    if shortest < np.inf:
        for corner in range(3):
            weights[corner] += shortest * rates[corner]
    after, before = (exit_corner + 1) % 3, (exit_corner + 2) % 3
    first, second = max(weights[after], 0.0), max(weights[before], 0.0)
    share = second / (first + second) if first + second > 0.0 else 0.5
    exit_point = _difference(vertices[corners[before]], vertices[corners[after]])
    for axis in range(3):
        exit_point[axis] = vertices[corners[after], axis] + share * exit_point[axis]
    return exit_point, exit_corner, share


@kernel
def _leads_away_from_edge(
    vertices: Float64Array, corners: Int32Array, distances: Float32Array, left: int, right: int
) -> bool:
    """Whether the descent on a face leads from its edge (left, right) into the face."""
    if not _is_reached(corners, distances):
        return False
    rates = _barycentric_rates(vertices, corners, _descent_direction(vertices, corners, distances))
    for corner in range(3):
        if corners[corner] != left and corners[corner] != right:
            return bool(rates[corner] > 0.0)
    return False


@kernel
def _steepest_way(
    vertices: Float64Array,
    faces: Int32Array,
    vertex_face_offsets: Int32Array,
    vertex_faces: Int32Array,
    distances: Float32Array,
    predecessors: Int32Array,
    vertex: int,
) -> tuple[int, int]:
    """Choose the way down from a vertex: (face, -1) through a face, or (face, next vertex) along one of its edges."""
    best_slope, best_face, best_vertex = 0.0, vertex_faces[vertex_face_offsets[vertex]], predecessors[vertex]
    for record in range(vertex_face_offsets[vertex], vertex_face_offsets[vertex + 1]):
        face = vertex_faces[record]
        corners = faces[face]
        if not _is_reached(corners, distances):
            continue
        descent = _descent_direction(vertices, corners, distances)
        rates = _barycentric_rates(vertices, corners, descent)
        inside = True
        for corner in range(3):
            if corners[corner] == vertex:
                continue
            inside = inside and rates[corner] > 0.0
            fall = float(distances[vertex]) - float(distances[corners[corner]])
            edge = _difference(vertices[corners[corner]], vertices[vertex])
            slope = fall / math.sqrt(_dot(edge, edge))
            if slope > best_slope:
                best_slope, best_face, best_vertex = slope, face, corners[corner]
        slope = math.sqrt(_dot(descent, descent))
        if inside and slope > best_slope:
            best_slope, best_face, best_vertex = slope, face, -1
    return best_face, best_vertex
