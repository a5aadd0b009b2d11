"""Dijkstra that remembers: after a local change of costs only the affected part of the wave is computed again.

Made for replanning at a rate while driving to one goal: the wave starts at the goal and covers the whole surface, so
a moved robot costs nothing but reading its path, and a new obstacle costs its shadow in the wave. Results are those
of ``mesh.dijkstra``. Known failure: with ever changing goals or via points it computes whole fields for nothing (it
remembers one goal); use ``mesh.astar`` then. A big change near the goal is as expensive as starting over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.dijkstra import propagate_distances
from mbf_mesh_nav.kernels.repair_wave import forget_changed_ways
from mbf_mesh_nav.leg_search import (
    NO_OFFSETS,
    NO_TARGETS,
    Leg,
    LegQuery,
    seeded_arrays,
    threshold_step,
    vertex_path_leg,
)
from mbf_mesh_nav.mesh_map import MeshSnapshot
from mbf_mesh_nav.surface_planner import SurfacePlanner


@dataclass
class RememberedWave:
    """A finished field and what it was computed for."""

    goal: tuple[float, ...]
    roots: NDArray[np.int32]
    snapshot: MeshSnapshot
    blocked: NDArray[np.bool_]
    edge_cost_factor: float
    distances: NDArray[np.float32]
    predecessors: NDArray[np.int32]


class RepairingPlanner(SurfacePlanner):
    """Cheapest way along edges, replanned at the price of the change."""

    _wave: RememberedWave | None = None

    def find_leg(self, query: LegQuery) -> Leg | None:
        """Bring the remembered wave up to date, or start a new one, and read the way off it."""
        wave, self._wave = self._wave, None  # a cancelled repair leaves no half-finished wave behind
        if wave is None or not self._fits(wave, query):
            wave, seeds = self._new_wave(query)
        else:
            seeds = self._outdated(wave, query)
            wave.snapshot, wave.blocked = query.snapshot, query.blocked
        finished = propagate_distances(
            self.mesh_map.neighbour_offsets,
            self.mesh_map.neighbours,
            query.snapshot.edge_weights,
            query.blocked,
            wave.distances,
            wave.predecessors,
            seeds,
            threshold_step(self.mesh_map),
            NO_TARGETS,
            NO_OFFSETS,
            query.cancel_flag,
        )
        if not finished:
            return None
        self._wave = wave
        return vertex_path_leg(self.mesh_map, query, wave.distances, wave.predecessors, rooted_at_goal=True)

    def _fits(self, wave: RememberedWave, query: LegQuery) -> bool:
        """Whether the wave leads to this goal, from the same free corners, with the same weighting."""
        return (
            wave.goal == tuple(query.goal.point)
            and not query.blocked[wave.roots].any()
            and wave.edge_cost_factor == self.mesh_map.edge_cost_factor
        )

    def _new_wave(self, query: LegQuery) -> tuple[RememberedWave, NDArray[np.int32]]:
        distances, predecessors, seeds = seeded_arrays(self.mesh_map, query.blocked, query.goal)
        goal, factor = tuple(query.goal.point), self.mesh_map.edge_cost_factor
        wave = RememberedWave(goal, seeds, query.snapshot, query.blocked, factor, distances, predecessors)
        return wave, seeds

    def _outdated(self, wave: RememberedWave, query: LegQuery) -> NDArray[np.int32]:
        """Forget what hung on vertices that changed since the wave; return the seeds of the repair."""
        old, new = wave.snapshot, query.snapshot
        if old.version == new.version:
            return np.zeros(0, dtype=np.int32)
        changed = (old.costs != new.costs) | (old.lethal != new.lethal) | (wave.blocked != query.blocked)
        is_root = np.zeros(len(changed), dtype=np.bool_)
        is_root[wave.roots] = True
        return forget_changed_ways(
            self.mesh_map.neighbour_offsets,
            self.mesh_map.neighbours,
            query.blocked,
            wave.distances,
            wave.predecessors,
            is_root,
            np.flatnonzero(changed).astype(np.int32),
        )
