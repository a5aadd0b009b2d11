"""Other courses between two points of a coarse mesh: faces so long that a wave misjudges on which side to pass.

A geodesic through faces is shortest among its neighbours only, so which one is found depends on the wave.
Two waves, from the goal and from the start, give for every vertex the length of a path through it; the paths through
the most promising vertices that no course found so far passes are shortened as well. The shortest of all is led round
the other side of every vertex beside it (``kernels.wave.corridor_detours``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mbf_mesh_nav.arrays import Float32Array
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.search.corridor import Corridor, Piece, joined
from mbf_mesh_nav.search.leg_search import LegQuery

FEW_FACES = 150
"""A path through more faces than this is no matter of single faces."""
_COURSES = 12
_WORTH_A_TRY = 1.15
"""Paths through a vertex so many times longer than the best course are not tried."""
_SHORTER = 0.999
"""A course is another one only if it is shorter than so many times the length of the best before."""

Distances = Float32Array
Trace = Callable[[SurfacePoint], Piece]
"""The descent of a field from a surface point."""


def is_worth_a_search(query: LegQuery, course: Piece, corridor: Corridor) -> bool:
    """Whether a course leads through few faces, and not straight to its goal anyway."""
    straight = math.dist(query.start.point, query.goal.point)
    return len(course[1]) <= FEW_FACES and straight < _SHORTER * corridor.cost(*course)


class OtherCourses:
    """Courses of one query; the traces lead down the fields of the waves from its goal and from its start."""

    def __init__(self, mesh_map: MeshMap, query: LegQuery, corridor: Corridor, to_goal: Trace, to_start: Trace) -> None:
        self._mesh_map, self._query, self._corridor = mesh_map, query, corridor
        self._to_goal, self._to_start = to_goal, to_start

    def best(self, course: Piece, from_goal: Distances, from_start: Distances) -> Piece:
        """The cheapest course found, the given one unless another is clearly cheaper.

        Parameters
        ----------
        course : positions (n, 3), faces (n,)
        from_goal, from_start : (V,) float32
            Distances of the two waves [m].
        """
        reversed_course = self._corridor.shorten(*_reversed(self._to_start(self._query.goal)))
        best = min(course, reversed_course, key=lambda piece: self._cost(piece, course))
        beside = np.zeros(len(from_goal), dtype=np.bool_)
        for piece in (course, reversed_course):
            beside[self._mesh_map.faces[piece[1]]] = True
        lengths, tried = from_goal + from_start, 0
        for vertex in np.argsort(lengths, kind="stable").tolist():
            if tried >= _COURSES or not lengths[vertex] <= _WORTH_A_TRY * self._corridor.cost(*best):
                break
            place = None if beside[vertex] else self._free_place(vertex)
            if place is None:
                continue
            tried += 1
            through = self._corridor.shorten(*joined(_reversed(self._to_start(place)), self._to_goal(place)))
            beside[self._mesh_map.faces[through[1]]] = True
            best = min(best, through, key=lambda piece: self._cost(piece, course))
        return min(best, self._corridor.pass_vertices(*best), key=lambda piece: self._cost(piece, course))

    def _cost(self, piece: Piece, course: Piece) -> float:
        """Cost [m] of a piece; that of the given course is a little less than it is, so that it stays where it may."""
        cost = self._corridor.cost(*piece)
        return _SHORTER * cost if piece is course else cost

    def _free_place(self, vertex: int) -> SurfacePoint | None:
        """A vertex in a face without a blocked corner."""
        mesh_map = self._mesh_map
        begin, end = mesh_map.vertex_face_offsets[vertex : vertex + 2]
        for face in mesh_map.vertex_faces[begin:end].tolist():
            corners = mesh_map.faces[face]
            if not self._query.blocked[corners].any():
                return SurfacePoint(face, (corners == vertex).astype(np.float64), mesh_map.vertices[vertex].copy(), 0.0)
        return None


def _reversed(piece: Piece) -> Piece:
    """The path reversed; the face of the segment to a point is that of the segment from the one before it."""
    positions, faces = piece
    return positions[::-1], np.concatenate([faces[-1:], faces[:0:-1]])


def reversed_query(query: LegQuery) -> LegQuery:
    """The path reversed."""
    return replace(query, start=query.goal, goal=query.start, start_pose=query.goal_pose, goal_pose=query.start_pose)
