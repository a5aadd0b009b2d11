"""Continuous vector planner: a wave over faces, a path down its distance field, and the field for the controller.

Strengths: paths cross faces freely, so they are as short and smooth as the surface allows (within 0.5 % on average),
whatever the triangulation; every reachable pair gets a path; the field lets a controller correct deviations.
Known failure: passes only where whole faces are free, a chain of single free vertices does not count (``mesh.astar``
uses those); very obtuse triangles cost accuracy.
Cost: about 0.4 us a vertex nearer than the goal. The C++ original's rule and defaults; the path is traced exactly here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.parameters import parameter
from mbf_mesh_nav.kernels.corners import build_corner_slots
from mbf_mesh_nav.kernels.cvp import propagate_wave
from mbf_mesh_nav.kernels.descent import trace_descent
from mbf_mesh_nav.kernels.wave_directions import wave_directions
from mbf_mesh_nav.leg_search import Leg, LegQuery, drop_repeated_points, mean_edge_length, seeded_arrays, straight_leg
from mbf_mesh_nav.plugins import MeshContext
from mbf_mesh_nav.surface_planner import SurfacePlanner, SurfacePlannerParameters
from mbf_mesh_nav.vector_field import VectorField


class CVPParameters(SurfacePlannerParameters):
    """Parameters of ``mesh.cvp``."""

    goal_dist_offset: float = parameter(
        0.3, "How far beyond the robot the field is computed; a controller needs it to correct.", unit="m", ge=0.0
    )


class CVPPlanner(SurfacePlanner):
    """Wave from the goal, descent from the start."""

    Parameters = CVPParameters
    parameters: CVPParameters

    def __init__(self, context: MeshContext) -> None:
        super().__init__(context)
        mesh_map = self.mesh_map
        self._corner_slots = build_corner_slots(
            mesh_map.faces,
            mesh_map.vertex_face_offsets,
            mesh_map.vertex_faces,
            mesh_map.neighbour_offsets,
            mesh_map.neighbours,
        )

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Spread the wave until the robot's face is settled, trace the path, keep the field."""
        mesh_map = self.mesh_map
        start, goal = query.start, query.goal
        distances, predecessors, seeds = seeded_arrays(mesh_map, query.blocked, goal)
        if len(seeds) == 1:
            seeds = self._seed_around(query, int(seeds[0]), distances, predecessors)
        cut_records = np.full(len(distances), -1, dtype=np.int32)
        corners = mesh_map.faces[start.face]
        settled = propagate_wave(
            mesh_map.neighbour_offsets,
            mesh_map.neighbours,
            query.snapshot.edge_weights,
            mesh_map.vertex_face_offsets,
            self._corner_slots,
            query.blocked,
            distances,
            predecessors,
            cut_records,
            seeds,
            np.ascontiguousarray(corners[~query.blocked[corners]]),
            max(self.parameters.goal_dist_offset, 2.0 * mean_edge_length(mesh_map)),
            query.cancel_flag,
        )
        if settled < 0 or not np.isfinite(distances[corners]).any():
            return None
        directions = wave_directions(
            mesh_map.vertices,
            mesh_map.faces,
            mesh_map.vertex_faces,
            mesh_map.neighbours,
            query.snapshot.edge_weights,
            self._corner_slots,
            distances,
            predecessors,
            cut_records,
        )
        seeds = seeds[predecessors[seeds] < 0]
        towards_goal = goal.point - mesh_map.vertices[seeds]
        directions[seeds] = towards_goal / np.maximum(np.linalg.norm(towards_goal, axis=1, keepdims=True), 1e-9)
        field = VectorField(directions, distances, goal.face, goal.point.copy(), query.snapshot.version)
        if start.face == goal.face:
            line = straight_leg(mesh_map, query)
            return Leg(line.positions, line.normals, line.cost, field)
        positions, point_faces = trace_descent(
            mesh_map.vertices,
            mesh_map.faces,
            mesh_map.face_neighbours,
            mesh_map.vertex_face_offsets,
            mesh_map.vertex_faces,
            distances,
            predecessors,
            start.face,
            start.point,
            goal.face,
            goal.point,
            4 * len(mesh_map.faces),
        )
        # The potential at the start is the cost of the way.
        cost = float(np.min(distances[corners] + np.linalg.norm(mesh_map.vertices[corners] - start.point, axis=1)))
        return drop_repeated_points(Leg(positions, mesh_map.face_normals[point_faces], cost, field))

    def _seed_around(
        self, query: LegQuery, center: int, distances: NDArray[np.float32], predecessors: NDArray[np.int32]
    ) -> NDArray[np.int32]:
        """Seed the ring of a goal face's only free corner too: a wave needs two known corners to enter a face."""
        mesh_map = self.mesh_map
        slots = slice(mesh_map.neighbour_offsets[center], mesh_map.neighbour_offsets[center + 1])
        ring = mesh_map.neighbours[slots]
        free = ~query.blocked[ring]
        ring = ring[free]
        distances[ring] = distances[center] + query.snapshot.edge_weights[slots][free]
        predecessors[ring] = center
        return np.concatenate([[center], ring]).astype(np.int32)
