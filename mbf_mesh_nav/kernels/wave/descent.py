"""Exact descent of a distance field: the path is traced from edge to edge, never stepped and searched for.

At a point of a face the wave's own rule is applied once more (``cvp.propagate_wave``): two corners that one front has
passed give its centre, a virtual source; the path leads straight there, if that line crosses the side between the
two, else to the corner over which it is shortest. A field taken as linear within a face would be wrong by a tenth
some edges away from the source, where the fronts are round. A virtual source of two fronts is a fiction and may lead
in circles: no face is passed through twice, and from corner to corner the distance falls. Thus the trace ends, and
every reached point gets a path.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import Count, inner_array_kernel, inner_kernel, kernel
from mbf_mesh_nav.kernels.fill import fill
from mbf_mesh_nav.kernels.mesh.surface import Surface
from mbf_mesh_nav.kernels.mesh.vectors import Vector, between, row, set_row
from mbf_mesh_nav.kernels.wave.fronts import NO_BEND, SLACK
from mbf_mesh_nav.kernels.wave.weighted_faces import barycentric, on_side, side_weights, weighted_length

_ON_VERTEX = 1e-6  # a crossing this near (as a share of the edge) to a vertex is the vertex
_NO_SIDE = -1


class Field(NamedTuple):
    """Weights (2E,) of the edges [m] and what the wave made of them, see ``cvp.propagate_wave``."""

    edge_weights: Float32Array
    distances: Float32Array
    predecessors: IntArray
    bends: IntArray


@kernel
def trace_descent(
    surface: Surface, field: Field, start_face: int, start: Vector, goal_face: int, goal: Vector, along_edges: bool
) -> tuple[FloatArray, IntArray]:
    """Trace the path down from ``start`` to the source of the field at ``goal``.

    Parameters
    ----------
    surface : Surface
        The mesh.
    field : Field
        The wave's result; at least one corner of ``start_face`` is reached.
    start_face, goal_face : int
        Different faces.
    start, goal : (float, float, float)
        Points in them [m].
    along_edges : bool
        Follow the predecessors only: a longer path, but surely the one along which the wave came.

    Returns
    -------
    points : (n, 3) float64
        From start to goal, one point per crossed edge or visited vertex [m].
    point_faces : (n,) int32
        The face the segment to each point lies in (or on an edge of); the start's own face first.
    """
    capacity = Count(256)
    points = np.empty((capacity, 3), dtype=np.float64)
    point_faces = np.empty(capacity, dtype=np.int32)
    vertices, faces = surface.vertices, surface.faces
    passed = np.empty(len(faces), dtype=np.bool_)
    fill(passed, Count(0))
    face, vertex = Count(start_face), Count(-1)
    place = barycentric(vertices, faces[face], start)
    set_row(points, Count(0), start)
    point_faces[0] = face
    count = Count(1)
    while True:
        # 1. In the goal's face, or at one of its corners, the rest is a straight line.
        if (vertex < 0 and face == goal_face) or (vertex >= 0 and _has_corner(faces[goal_face], vertex)):
            set_row(points, count, goal)
            point_faces[count] = goal_face
            return points[: count + 1].copy(), point_faces[: count + 1].copy()
        if count + 2 > capacity:
            capacity *= 2
            points, point_faces = _grown(points, point_faces, capacity)
        # 2. Which continuation is the shortest: through one of the sides to a face not passed yet, or over a corner?
        if vertex >= 0:
            face, side, share, vertex = _way_from_vertex(surface, field, goal_face, passed, vertex, along_edges)
        else:
            _, side, share, vertex = _way_through(surface, field, goal_face, passed, face, place, along_edges)
        # 3. Store where it leads, and continue there.
        if vertex < 0:
            left, right = Count(faces[face, side]), Count(faces[face, (side + 1) % 3])
            passed[face] = True
            if share < _ON_VERTEX or share > 1.0 - _ON_VERTEX:
                vertex = left if share < 0.5 else right
        point_faces[count] = face
        if vertex >= 0:
            set_row(points, count, row(vertices, vertex))
        else:
            set_row(points, count, between(row(vertices, left), row(vertices, right), share))
            face = Count(surface.face_neighbours[face, side])
            place = on_side(_side_of(faces[face], right), 1.0 - share)
        count += 1


@inner_array_kernel
def _grown(points: FloatArray, point_faces: IntArray, capacity: int) -> tuple[FloatArray, IntArray]:
    more_points, more_faces = np.empty((capacity, 3), dtype=np.float64), np.empty(capacity, dtype=np.int32)
    for i in range(len(points)):
        set_row(more_points, i, row(points, i))
        more_faces[i] = point_faces[i]
    return more_points, more_faces


@inner_kernel
def _has_corner(corners: IntArray, vertex: int) -> bool:
    return bool(corners[0] == vertex or corners[1] == vertex or corners[2] == vertex)


@inner_kernel
def _side_of(corners: IntArray, vertex: int) -> int:
    """Number of the side that begins at a corner."""
    side = 0 if corners[0] == vertex else (1 if corners[1] == vertex else 2)
    return Count(side)  # type: ignore[no-any-return]


@inner_kernel
def _way_through(
    surface: Surface, field: Field, goal_face: int, passed: BoolArray, face: int, place: Vector, over_corner: bool
) -> tuple[float, int, float, int]:
    """Find the shortest continuation from a point of a face: length, side, the share of it, or the corner (else -1).

    It goes to no face that has been ``passed`` (F,), or to a corner in any case (``over_corner``). Where one is not
    reached, only the others count.
    """
    corners, distances = surface.faces[face], field.distances
    sides = side_weights(surface, field.edge_weights, corners)
    best, best_side, best_share, best_vertex = np.inf, Count(_NO_SIDE), 0.0, Count(-1)
    lengths = (
        weighted_length(sides, (place[0] - 1.0, place[1], place[2])),
        weighted_length(sides, (place[0], place[1] - 1.0, place[2])),
        weighted_length(sides, (place[0], place[1], place[2] - 1.0)),
    )
    for corner in range(3):
        total = distances[corners[corner]] + lengths[corner]
        if total < best:
            best, best_vertex = total, Count(corners[corner])
    for side in range(0 if over_corner else 3):
        if not _leads_on(surface.faces, surface.face_neighbours[face, side], distances, goal_face, passed):
            continue
        left, right = Count(corners[side]), Count(corners[(side + 1) % 3])
        total, share = _over_side(field, left, right, sides[side], lengths[side], lengths[(side + 1) % 3])
        if total < best:
            best, best_side, best_share, best_vertex = total, Count(side), share, Count(-1)
    return best, best_side, best_share, best_vertex


@inner_kernel
def _is_reached(corners: IntArray, distances: Float32Array) -> bool:
    return bool(distances[corners[0]] < np.inf and distances[corners[1]] < np.inf and distances[corners[2]] < np.inf)


@inner_kernel
def _leads_on(faces: IntArray, following: int, distances: Float32Array, goal_face: int, passed: BoolArray) -> bool:
    """Whether the trace may enter a face: the goal's, or one that is reached and has not been passed (F,)."""
    if following < 0 or passed[following]:
        return False
    return bool(following == goal_face or _is_reached(faces[following], distances))


@inner_kernel
def _over_side(field: Field, left: int, right: int, c: float, b: float, a: float) -> tuple[float, float]:
    """Length of the straight line through a side to the centre of the front, and where it crosses the side.

    ``c``, ``b``, ``a`` are the side and the lengths from the point to its left and right end. The length is inf where
    the line would not cross the side; the crossing is a share of the side from its left end.
    """
    distances, bend = field.distances, field.bends[left]
    to_bend = float(distances[bend]) if bend == field.bends[right] and bend != NO_BEND else 0.0
    u1, u2 = float(distances[left]) - to_bend, float(distances[right]) - to_bend
    # The left end is the origin, the x axis runs to the right one; the point lies above, the virtual source below.
    source_x = (c * c + (u1 - u2) * (u1 + u2)) / (2.0 * c)
    point_x = (c * c + (b - a) * (b + a)) / (2.0 * c)
    if not abs(source_x) <= SLACK * u1:
        return np.inf, 0.0
    depth = math.sqrt(max((u1 - source_x) * (u1 + source_x), 0.0))
    height = math.sqrt(max((b - point_x) * (b + point_x), 0.0))
    across, along = height + depth, point_x - source_x
    crossing = source_x * height + point_x * depth  # times ``across``
    if not 0.0 < crossing < c * across:
        return np.inf, 0.0
    return to_bend + math.sqrt(across * across + along * along), crossing / (across * c)


@inner_kernel
def _way_from_vertex(
    surface: Surface, field: Field, goal_face: int, passed: BoolArray, vertex: int, to_predecessor: bool
) -> tuple[int, int, float, int]:
    """Choose the continuation from a vertex: (face, side, share, -1) through a face, or (face, -1, 0, next vertex)."""
    best, best_face, best_side, best_share = np.inf, Count(-1), Count(_NO_SIDE), 0.0
    best_vertex, distances = Count(field.predecessors[vertex]), field.distances
    records = range(surface.vertex_face_offsets[vertex], surface.vertex_face_offsets[vertex + 1])
    for record in records:
        face = Count(surface.vertex_faces[record])
        corners = surface.faces[face]
        # A free face is preferred: its side may have a blocked face on the other side.
        if _has_corner(corners, best_vertex) and (best_face < 0 or _is_reached(corners, distances)):
            best_face = face
    if to_predecessor:
        return best_face, best_side, best_share, best_vertex
    for record in records:
        face = Count(surface.vertex_faces[record])
        corners = surface.faces[face]
        if not _is_reached(corners, distances):
            continue
        own = _side_of(corners, vertex)
        sides = side_weights(surface, field.edge_weights, corners)
        for step in range(1, 3):
            other = Count(corners[(own + step) % 3])
            total = distances[other] + (sides[own] if step == 1 else sides[(own + 2) % 3])
            if distances[other] < distances[vertex] and total < best:
                best, best_face, best_side, best_share, best_vertex = total, face, Count(_NO_SIDE), 0.0, other
        opposite = (own + 1) % 3
        following = surface.face_neighbours[face, opposite]
        if passed[face] or not _leads_on(surface.faces, following, distances, goal_face, passed):
            continue
        left, right = Count(corners[opposite]), Count(corners[(opposite + 1) % 3])
        total, share = _over_side(field, left, right, sides[opposite], sides[own], sides[(own + 2) % 3])
        if total < best:
            best, best_face, best_side, best_share, best_vertex = total, face, Count(opposite), share, Count(-1)
    return best_face, best_side, best_share, best_vertex
