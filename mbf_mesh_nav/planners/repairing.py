"""Dijkstra that remembers: after a local change of costs only the affected part of the wave is computed again.

Made for replanning at a rate while driving to one goal: the wave starts at the goal and covers the whole surface, so
a moved robot costs nothing but reading its path, and a new obstacle costs its shadow in the wave. Results are those
of ``mesh.dijkstra``. Known failure: with ever changing goals or via points it computes whole fields for nothing (it
remembers one goal); use ``mesh.astar`` then. A big change near the goal is as expensive as starting over.
"""

from __future__ import annotations

from dataclasses import dataclass

from mbf_mesh_nav.arrays import Float32Array, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import propagate_distances
from mbf_mesh_nav.kernels.search.repair_wave import invalidate_subtrees
from mbf_mesh_nav.mesh.surface_point import corner_distances
from mbf_mesh_nav.search.leg_search import (
    NO_OFFSETS,
    NO_TARGETS,
    Leg,
    LegQuery,
    propagate_from,
    search_graph,
    seeded_arrays,
    threshold_step,
    vertex_path_leg,
)
from mbf_mesh_nav.search.surface_planner import SurfacePlanner


@dataclass
class RememberedWave:
    """A finished field and what it was computed for."""

    goal: list[float]
    cost_limit: float
    version: int
    roots: IntArray
    root_distances: Float32Array
    distances: Float32Array
    predecessors: IntArray


class RepairingPlanner(SurfacePlanner):
    """Cheapest path along edges; replanning costs as much as the change is large."""

    _wave: RememberedWave | None = None

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Bring the remembered wave up to date, or start a new one, and trace the path."""
        wave, self._wave = self._wave, None  # a cancelled repair leaves no half-finished wave behind
        changed = self._changes_since(wave, query) if wave is not None else None
        graph = search_graph(self.mesh_map, query.snapshot.edge_weights, query.blocked)
        if wave is None or changed is None:
            wave = self._new_wave(query)
            seeds = wave.roots
        else:
            fields = wave.distances, wave.predecessors, wave.roots, wave.root_distances
            seeds = invalidate_subtrees(graph, *fields, changed)
            wave.version = query.snapshot.version
        step = threshold_step(self.mesh_map)
        if not propagate_distances(
            graph, wave.distances, wave.predecessors, seeds, step, NO_TARGETS, NO_OFFSETS, query.cancel_flag
        ):
            return None
        self._wave = wave
        return vertex_path_leg(self.mesh_map, query, wave.distances, wave.predecessors, rooted_at_goal=True)

    def find_other_leg(self, query: LegQuery) -> Leg | None:
        """Search from the start; the remembered wave is of the map as it is."""
        search = self.mesh_map, query.snapshot, query.blocked, query.start, query.cancel_flag, query.goal
        distances, predecessors, finished = propagate_from(*search, guided=True)
        return vertex_path_leg(self.mesh_map, query, distances, predecessors) if finished else None

    def _changes_since(self, wave: RememberedWave, query: LegQuery) -> IntArray | None:
        """Vertices that changed since the wave; None if it leads elsewhere, or the changes are not remembered."""
        roots, offsets = corner_distances(self.mesh_map, query.blocked, query.goal, query.snapshot)
        same_source = (
            wave.goal == query.goal.point.tolist()
            and wave.roots.tolist() == roots.tolist()
            and wave.root_distances.tolist() == offsets.tolist()
        )
        if not same_source or wave.cost_limit != self.parameters.cost_limit:
            return None
        return self.mesh_map.changes_between(wave.version, query.snapshot.version)

    def _new_wave(self, query: LegQuery) -> RememberedWave:
        snapshot = query.snapshot
        distances, predecessors, seeds = seeded_arrays(self.mesh_map, query.blocked, query.goal, snapshot)
        goal, version = query.goal.point.tolist(), query.snapshot.version
        return RememberedWave(
            goal, self.parameters.cost_limit, version, seeds, distances[seeds], distances, predecessors
        )
