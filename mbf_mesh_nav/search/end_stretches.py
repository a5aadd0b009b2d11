"""The first and the last stretch of a path along edges: from the start to a corner of its face, from one to the goal.

A stretch is driven straight, so the robot turns to it, drives it with that heading and turns again; all of that has to
keep the tilt's limits, as on the path between. Where the robot stands beyond them already, it may leave as it stands.
A robot near a corner of its face would have to turn to it for a stretch of some centimetres, which a rut may not allow.
So a first stretch may also lead beyond: to all vertices that two moves from the corner lead to.
"""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_mesh_nav.arrays import Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.search.heading_astar import HEADING_STEP, HEADINGS
from mbf_mesh_nav.layers.tilt import heading_index
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.mesh.locate import SurfacePoint
from mbf_mesh_nav.mesh.surface_point import corner_distances, nearest_corner, passes_blocked_corner, point_of_face
from mbf_mesh_nav.search.drive_graph import DriveGraph
from mbf_mesh_nav.search.heading_limits import HeadingLimits
from mbf_mesh_nav.search.leg_search import LegQuery
from mbf_mesh_nav.search.path_cost import cost_along
from mbf_mesh_nav.search.straight_line import StraightLine, line_over_ground

AT_ONE_PLACE = 1e-6
"""Start and goal this near [m], or a corner and one of them, have no direction between them."""
ANY_HEADING = -1
ROUNDED = 2e-3
"""A tolerance may be so little [rad] less than meant: 3.14 is half a turn."""

Offsets = Float32Array


class EndStretches:
    """Stretches of one query.

    Parameters
    ----------
    turning_cost : float
        Extra length [m] per rad turned.
    graph : DriveGraph
        Of the moves that say how far a first stretch may lead.
    """

    def __init__(
        self, mesh_map: MeshMap, limits: HeadingLimits, query: LegQuery, turning_cost: float, graph: DriveGraph
    ) -> None:
        self._mesh_map, self._limits, self._query, self._graph = mesh_map, limits, query, graph
        self._turn_cost = turning_cost * HEADING_STEP
        self._bearable = max(1.0, self._use(query.start, query.start_pose))
        self._goal_headings = headings_within(query.goal_pose, query.angle_tolerance)

    def from_start(self) -> tuple[IntArray, Offsets]:
        """States (s,) a search begins with, vertex times ``HEADINGS`` plus heading, and what they cost (s,) [m]."""
        query, corners = self._query, []
        heading = None if query.start_pose is None else heading_index(query.start_pose.yaw)
        for corner, offset in self._corners(query.start):
            away = self._mesh_map.vertices[corner]
            if math.dist(query.start.point, away) <= AT_ONE_PLACE:
                corners.append((corner * HEADINGS + (heading or 0), offset))
                continue
            driven = heading_towards(query.start.point, away)
            normals = [self._mesh_map.face_normals[query.start.face], self._mesh_map.vertex_normals[corner]]
            use = self._limits.driving(query.start.face, query.start.point, away, normals)
            turn = 0 if heading is None else shortest_turn(heading, driven)
            if use <= self._bearable and self._may_turn(query.start, query.start_pose, driven - turn, turn):
                corners.append((corner * HEADINGS + driven, offset + self._turn_cost * abs(turn)))
        return _columns([*corners, *self._beyond_corners(heading)])

    def _beyond_corners(self, heading: int | None) -> list[tuple[int, float]]:
        """States at the ends of lines over the ground, up to two moves from the nearest corner, and their costs [m].

        None for limits that know faces but no footprint, and none along a line that comes nearest to a blocked vertex.
        """
        query, mesh_map, states = self._query, self._mesh_map, []
        if not self._limits.knows_footprint:
            return []
        near = self._graph.ends_from(np.array([nearest_corner(mesh_map, query.start)]))
        for end in np.setdiff1d(self._graph.ends_from(near), mesh_map.faces[query.start.face]).tolist():
            place = mesh_map.vertices[end]
            line = line_over_ground(mesh_map.topology, query.start.face, query.start.point, place)
            if line is None or query.blocked[end] or self._passes_blocked(line):
                continue
            driven = heading_towards(query.start.point, place)
            turn = 0 if heading is None else shortest_turn(heading, driven)
            if self._may_turn(query.start, query.start_pose, driven - turn, turn) and self._may_drive(line):
                cost = cost_along(mesh_map, query.snapshot, line.points, line.faces[[0, *range(len(line.faces))]])
                states.append((end * HEADINGS + driven, cost + self._turn_cost * abs(turn)))
        return states

    def _passes_blocked(self, line: StraightLine) -> bool:
        """Whether a blocked corner is the nearest of its face anywhere on a line."""
        mesh_map = self._mesh_map
        for face, begin, end in zip(line.faces.tolist(), line.points[:-1], line.points[1:], strict=True):
            blocked = self._query.blocked[mesh_map.faces[face]]
            if not blocked.any():
                continue
            first, last = (point_of_face(mesh_map, face, point) for point in (begin, end))
            at_ends = blocked[[np.argmax(first.barycentric), np.argmax(last.barycentric)]].any()
            if at_ends or passes_blocked_corner(first, last, blocked):
                return True
        return False

    def _may_drive(self, line: StraightLine) -> bool:
        """Whether a line from the start keeps the limits, or what the robot bears where it stands."""
        pieces = zip(line.faces.tolist(), line.points[:-1], line.points[1:], strict=True)
        return all(self._limits.driving(face, begin, end, []) <= self._bearable for face, begin, end in pieces)

    def to_goal(self) -> tuple[IntArray, Offsets, IntArray]:
        """Vertices (t,) a search ends at, what is left from them to the goal (t,) [m], and which headings (t,)."""
        query, corners, headings = self._query, [], []
        for corner, offset in self._corners(query.goal):
            away = self._mesh_map.vertices[corner]
            if math.dist(query.goal.point, away) <= AT_ONE_PLACE:
                for heading in sorted(self._goal_headings) if self._goal_headings else [ANY_HEADING]:
                    if heading == ANY_HEADING or self._stands_at_goal(heading):
                        corners.append((corner, offset))
                        headings.append(heading)
                continue
            driven = heading_towards(away, query.goal.point)
            normals = [self._mesh_map.vertex_normals[corner], self._mesh_map.face_normals[query.goal.face]]
            turn = self._turn_at_goal(driven)
            if turn is not None and self._limits.driving(query.goal.face, away, query.goal.point, normals) <= 1.0:
                corners.append((corner, offset + self._turn_cost * abs(turn)))
                headings.append(driven)
        return *_columns(corners), np.array(headings, dtype=np.int32)

    def may_drive_straight(self) -> bool:
        """Whether the line to the goal, in the same face, keeps the limits, the free surface and the allowed turns."""
        query = self._query
        heading = None if query.start_pose is None else heading_index(query.start_pose.yaw)
        if math.dist(query.start.point, query.goal.point) <= AT_ONE_PLACE:
            return self._turn_at_goal(heading or 0) is not None
        if passes_blocked_corner(query.start, query.goal, query.blocked[self._mesh_map.faces[query.goal.face]]):
            return False
        driven = heading_towards(query.start.point, query.goal.point)
        turn = 0 if heading is None else shortest_turn(heading, driven)
        normals = [self._mesh_map.face_normals[query.start.face]]
        use = self._limits.driving(query.goal.face, query.start.point, query.goal.point, normals)
        begins = use <= 1.0 and self._may_turn(query.start, query.start_pose, driven - turn, turn)
        return begins and self._turn_at_goal(driven) is not None

    def _turn_at_goal(self, driven: int) -> int | None:
        """Least turn at the goal, in steps, to a requested heading; None if none is allowed."""
        turns = [shortest_turn(driven, heading) for heading in sorted(self._goal_headings)] or [0]
        for turn in sorted(turns, key=abs):
            passed = [driven + math.copysign(step, turn) for step in range(1, abs(turn) + 1)]
            if all(self._stands_at_goal(int(heading) % HEADINGS) for heading in passed):
                return turn
        return None

    def _stands_at_goal(self, heading: int) -> bool:
        """Whether the goal allows a heading; the requested one is taken as it is, not rounded."""
        pose = self._query.goal_pose
        is_asked = pose is not None and heading == heading_index(pose.yaw)
        yaw = pose.yaw if is_asked and pose is not None else heading * HEADING_STEP
        return self._limits.standing(self._query.goal, yaw) <= 1.0

    def _may_turn(self, place: SurfacePoint, pose: Pose | None, heading: int, turn: int) -> bool:
        """Whether all headings passed at the start are allowed; the last one, the stretch's, is looked at with it."""
        passed = [heading + math.copysign(step, turn) for step in range(1, abs(turn))]
        return pose is None or all(
            self._limits.standing(place, step * HEADING_STEP) <= self._bearable for step in passed
        )

    def _corners(self, place: SurfacePoint) -> list[tuple[int, float]]:
        """Free corners of a point's face and the costs of the lines to them [m]."""
        corners, offsets = corner_distances(self._mesh_map, self._query.blocked, place, self._query.snapshot)
        return list(zip(corners.tolist(), offsets.tolist(), strict=True))

    def _use(self, place: SurfacePoint, pose: Pose | None) -> float:
        return 0.0 if pose is None else self._limits.standing(place, pose.yaw)


def heading_towards(start: FloatArray, end: FloatArray) -> int:
    """Index of the heading nearest to that from one point to another."""
    return heading_index(math.atan2(end[1] - start[1], end[0] - start[0]))


def shortest_turn(heading: int, new_heading: int) -> int:
    """Steps to turn from one heading to another on the shorter side, left positive; half a turn goes left."""
    turn = (new_heading - heading) % HEADINGS
    return turn if turn <= HEADINGS // 2 else turn - HEADINGS


def headings_within(pose: Pose | None, tolerance: float) -> set[int]:
    """Headings within a tolerance [rad] of a pose, its own one included; none if all will do."""
    if pose is None:
        return set()
    offsets = [abs(math.remainder(heading * HEADING_STEP - pose.yaw, math.tau)) for heading in range(HEADINGS)]
    within = {heading for heading, offset in enumerate(offsets) if offset <= tolerance + ROUNDED} | {
        heading_index(pose.yaw)
    }
    return within if len(within) < HEADINGS else set()


def _columns(pairs: list[tuple[int, float]]) -> tuple[IntArray, Offsets]:
    return (
        np.array([first for first, _ in pairs], dtype=np.int32),
        np.array([second for _, second in pairs], dtype=np.float32),
    )
