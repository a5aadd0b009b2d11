"""Shortest path along mesh edges by Dijkstra's algorithm, stopping at the goal.

Strengths: exact on the vertex graph, fast, passes chains of single free vertices that face-wise planners cannot.
Known failure: on a regular grid a path along edges zigzags and is up to 41 % (17 % on average) longer than needed;
use ``mesh.cvp`` or ``mesh.any_angle`` for short, smooth paths, ``mesh.astar`` for the same path with less work.
Cost: about 60 ns a vertex that is nearer than the goal.
"""

from __future__ import annotations

from mbf_mesh_nav.search.leg_search import Leg, LegQuery, propagate_from, vertex_path_leg
from mbf_mesh_nav.search.surface_planner import SurfacePlanner


class DijkstraPlanner(SurfacePlanner):
    """Cheapest path along edges, found without a heuristic."""

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Expand from the start until the goal is settled, then trace back."""
        distances, predecessors, finished = propagate_from(
            self.mesh_map, query.snapshot, query.blocked, query.start, query.cancel_flag, query.goal
        )
        return vertex_path_leg(self.mesh_map, query, distances, predecessors) if finished else None
