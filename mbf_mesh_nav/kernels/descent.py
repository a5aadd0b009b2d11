"""Exact descent of a distance field: the path is traced from edge to edge, never stepped and searched for.

Within a face the field is taken as linear, so the way down is a straight line to an edge. Crossing an edge it goes on
in the next face, in a valley it follows the edge, at a vertex it takes the steepest face or edge. The field falls
strictly from crossing to crossing, so the trace ends at the source; where rounding makes the field stall, the wave's
predecessors, which are acyclic, take over. Thus every reached point gets a path.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.kernels.compiled import Count, inner_kernel, kernel
from mbf_mesh_nav.kernels.dijkstra import Float32Array, Int32Array
from mbf_mesh_nav.kernels.vectors import Float64Array, Vector, between, difference, dot, norm, row, set_row

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
    start: Vector,
    goal_face: int,
    goal: Vector,
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
    start, goal : (float, float, float)
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
    capacity = Count(256)
    points = np.empty((capacity, 3), dtype=np.float64)
    point_faces = np.empty(capacity, dtype=np.int32)
    count = Count(0)
    face, vertex, point = Count(start_face), Count(-1), start
    _note(points, point_faces, count, point, face)
    count += 1
    if not _is_reached(faces[face], distances):
        vertex = _best_corner(vertices, faces[face], distances, point)
    while True:
        # 1. In the goal's face, or at one of its corners, the rest is a straight line.
        if (vertex < 0 and face == goal_face) or (vertex >= 0 and _has_corner(faces[goal_face], vertex)):
            if vertex >= 0:
                _note(points, point_faces, count, row(vertices, vertex), face)
                count += 1
            _note(points, point_faces, count, goal, Count(goal_face))
            return points[: count + 1].copy(), point_faces[: count + 1].copy()
        if count + 3 > capacity:
            capacity *= 2
            points, point_faces = _grown(points, point_faces, capacity)
        # 2. At a vertex: note it, then choose the steepest way on.
        if vertex >= 0:
            point = row(vertices, vertex)
            _note(points, point_faces, count, point, face)
            count += 1
            if count > max_crossings:
                face, vertex = Count(vertex_faces[vertex_face_offsets[vertex]]), Count(predecessors[vertex])
                continue
            face, vertex = _steepest_way(
                vertices, faces, vertex_face_offsets, vertex_faces, distances, predecessors, vertex
            )
            if vertex >= 0:
                continue
        # 3. Straight down through the face to the edge opposite to corner `exit_corner`.
        corners = faces[face]
        point, exit_corner, share = _leave_face(vertices, corners, distances, point)
        left, right = Count(corners[(exit_corner + 1) % 3]), Count(corners[(exit_corner + 2) % 3])
        if share < _ON_VERTEX or share > 1.0 - _ON_VERTEX or count > max_crossings:
            vertex = left if share < 0.5 else right
            continue
        _note(points, point_faces, count, point, face)
        count += 1
        # 4. Go on in the next face, or along the edge where the next face rises.
        following = face_neighbours[face, (exit_corner + 1) % 3]
        if following >= 0 and _leads_away_from_edge(vertices, faces[following], distances, left, right):
            face = Count(following)
        else:
            vertex = left if distances[left] < distances[right] else right


@kernel
def _note(points: Float64Array, point_faces: Int32Array, count: int, point: Vector, face: int) -> None:
    """Write the point that follows the first ``count``."""
    set_row(points, count, point)
    point_faces[count] = face


@inner_kernel
def _grown(points: Float64Array, point_faces: Int32Array, capacity: int) -> tuple[Float64Array, Int32Array]:
    more_points, more_faces = np.empty((capacity, 3), dtype=np.float64), np.empty(capacity, dtype=np.int32)
    for i in range(len(points)):
        set_row(more_points, i, row(points, i))
        more_faces[i] = point_faces[i]
    return more_points, more_faces


@inner_kernel
def _is_reached(corners: Int32Array, distances: Float32Array) -> bool:
    return bool(distances[corners[0]] < np.inf and distances[corners[1]] < np.inf and distances[corners[2]] < np.inf)


@inner_kernel
def _has_corner(corners: Int32Array, vertex: int) -> bool:
    return bool(corners[0] == vertex or corners[1] == vertex or corners[2] == vertex)


@inner_kernel
def _best_corner(vertices: Float64Array, corners: Int32Array, distances: Float32Array, point: Vector) -> int:
    """Return the corner over which the way from ``point`` is shortest."""
    best, best_total = Count(corners[0]), np.inf
    for k in range(3):
        corner = Count(corners[k])
        total = distances[corner] + norm(difference(row(vertices, corner), point))
        if total < best_total:
            best, best_total = corner, total
    return best  # type: ignore[no-any-return]


@inner_kernel
def _face_edges(vertices: Float64Array, corners: Int32Array) -> tuple[Vector, Vector]:
    """Edge vectors from corner 0 of a face to corners 1 and 2."""
    origin = row(vertices, Count(corners[0]))
    return difference(row(vertices, Count(corners[1])), origin), difference(row(vertices, Count(corners[2])), origin)


@inner_kernel
def _descent_direction(vertices: Float64Array, corners: Int32Array, distances: Float32Array) -> Vector:
    """Negative gradient of the linear field on a face; its length is the slope of the field."""
    e1, e2 = _face_edges(vertices, corners)
    d1 = float(distances[corners[1]]) - float(distances[corners[0]])
    d2 = float(distances[corners[2]]) - float(distances[corners[0]])
    g11, g12, g22 = dot(e1, e1), dot(e1, e2), dot(e2, e2)
    determinant = max(g11 * g22 - g12 * g12, 1e-300)
    s1, s2 = (d2 * g12 - d1 * g22) / determinant, (d1 * g12 - d2 * g11) / determinant
    return s1 * e1[0] + s2 * e2[0], s1 * e1[1] + s2 * e2[1], s1 * e1[2] + s2 * e2[2]


@inner_kernel
def _barycentric_rates(vertices: Float64Array, corners: Int32Array, direction: Vector) -> Vector:
    """Change of the barycentric coordinates per unit of a direction in the face's plane."""
    e1, e2 = _face_edges(vertices, corners)
    g11, g12, g22 = dot(e1, e1), dot(e1, e2), dot(e2, e2)
    determinant = max(g11 * g22 - g12 * g12, 1e-300)
    p1, p2 = dot(direction, e1), dot(direction, e2)
    second, third = (p1 * g22 - p2 * g12) / determinant, (p2 * g11 - p1 * g12) / determinant
    return -second - third, second, third


@inner_kernel
def _leave_face(
    vertices: Float64Array, corners: Int32Array, distances: Float32Array, point: Vector
) -> tuple[Vector, int, float]:
    """Follow the descent through a face; the exit point, the corner opposite to its edge, its share of the edge.

    The share counts from the corner after the opposite one (counter-clockwise).
    """
    rates = _barycentric_rates(vertices, corners, _descent_direction(vertices, corners, distances))
    offsets = _barycentric_rates(vertices, corners, difference(point, row(vertices, Count(corners[0]))))
    weights = (offsets[0] + 1.0, offsets[1], offsets[2])
    exit_corner, shortest = 0, np.inf
    for corner in range(1, 3):
        exit_corner = corner if rates[corner] < rates[exit_corner] else exit_corner
    for corner in range(3):
        # A coordinate at zero belongs to the edge the way came in by.
        if rates[corner] < 0.0 and weights[corner] > 1e-9 and -weights[corner] / rates[corner] < shortest:
            exit_corner, shortest = corner, -weights[corner] / rates[corner]
    after, before = (exit_corner + 1) % 3, (exit_corner + 2) % 3
    travel = shortest if shortest < np.inf else 0.0
    first, second = max(weights[after] + travel * rates[after], 0.0), max(weights[before] + travel * rates[before], 0.0)
    share = second / (first + second) if first + second > 0.0 else 0.5
    exit_point = between(row(vertices, Count(corners[after])), row(vertices, Count(corners[before])), share)
    return exit_point, exit_corner, share


@inner_kernel
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


@inner_kernel
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
    best_slope, best_face = 0.0, Count(vertex_faces[vertex_face_offsets[vertex]])
    best_vertex = Count(predecessors[vertex])
    for record in range(vertex_face_offsets[vertex], vertex_face_offsets[vertex + 1]):
        face = Count(vertex_faces[record])
        corners = faces[face]
        if not _is_reached(corners, distances):
            continue
        descent = _descent_direction(vertices, corners, distances)
        rates = _barycentric_rates(vertices, corners, descent)
        inside = True
        for k in range(3):
            corner = Count(corners[k])
            if corner == vertex:
                continue
            inside = inside and rates[k] > 0.0
            fall = float(distances[vertex]) - float(distances[corner])
            slope = fall / norm(difference(row(vertices, corner), row(vertices, vertex)))
            if slope > best_slope:
                best_slope, best_face, best_vertex = slope, face, corner
        slope = norm(descent)
        if inside and slope > best_slope:
            best_slope, best_face, best_vertex = slope, face, Count(-1)
    return best_face, best_vertex
