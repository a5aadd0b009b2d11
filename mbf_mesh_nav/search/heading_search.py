"""The search of ``mesh.heading_astar``: guided by a wave from the goal, moves looked at last.

A footprint that is swept along a move costs a thousand times what a state costs to settle, and hardly any move is
forbidden whose two vertices are not. So a search takes what it does not know for drivable and only the moves of the
path it finds are looked at; where one is forbidden, that is known to the next search (Dellin and Srinivasa, "A unifying
formalism for shortest path problems with expensive edge evaluations via lazy best-first search", 2016). The cost is
that of a search which looks at every move. On ground where many fail, the last search does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, Float32Array, FloatArray, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, follow_predecessors, propagate_distances
from mbf_mesh_nav.kernels.search.goal_bound import GoalBound, weights_of_arrivals
from mbf_mesh_nav.kernels.search.heading_astar import FORBIDDEN, HEADINGS, find_out_along, search_with_heading
from mbf_mesh_nav.map.mesh_map import MeshMap
from mbf_mesh_nav.search.drive_graph import DriveGraph
from mbf_mesh_nav.search.heading_limits import HeadingLimits
from mbf_mesh_nav.search.leg_search import NO_OFFSETS, NO_TARGETS, LegQuery

CANCELLED = -2
"""What ``search_with_heading`` answers instead of a state."""
LAZY_SEARCHES = 8
"""Searches that take unknown moves for drivable, before one that looks at each."""
BEYOND_START = 0.02
"""How far the wave from the goal goes on behind the start, by the straight line between them: for detours ..."""
TURNS_BEYOND = 2.0 * math.pi
"""... and for turns [rad], which the wave leaves out."""

StartStates = tuple[IntArray, Float32Array]
"""States (s,) and what they cost (s,) [m]."""
GoalCorners = tuple[IntArray, Float32Array, IntArray]
"""Vertices (t,), what is left from them (t,) [m], and headings to turn to there (t,), -1 = any."""
NOWHERE: GoalCorners = (NO_TARGETS, NO_OFFSETS, NO_TARGETS)


@dataclass(frozen=True)
class PricedHeadings:
    """What roll and turns cost: extra lengths per length and rad of roll, extra length [m] per rad turned."""

    roll: float
    turning: float


@dataclass(frozen=True)
class _Task:
    """What one search is asked, with the weights (m,) [m] of all moves."""

    query: LegQuery
    limits: HeadingLimits
    costs: PricedHeadings
    weights: Float32Array
    start: StartStates
    goal: GoalCorners


class HeadingSearch:
    """Searches over (vertex, heading) on one map.

    Attributes
    ----------
    graph : DriveGraph
        What can be driven.
    """

    def __init__(self, mesh_map: MeshMap) -> None:
        self._mesh_map = mesh_map
        self.graph = DriveGraph(mesh_map.topology)
        self._kept: tuple[int, BoolArray, Float32Array] | None = None

    def cheapest_path(
        self, query: LegQuery, limits: HeadingLimits, costs: PricedHeadings, start: StartStates, goal: GoalCorners
    ) -> tuple[IntArray, float] | None:
        """Vertices (n,) of the cheapest path and its cost [m], ends included; None if there is none, or cancelled."""
        if not len(start[0]) or not len(goal[0]):
            return None
        task = _Task(query, limits, costs, self._weights(query), start, goal)
        bound = self._bound(task)
        for lazy_searches in range(LAZY_SEARCHES + 1):
            looks = lazy_searches == LAZY_SEARCHES
            best, cost, _, predecessors = self._search(task, bound, looks)
            if best < 0:
                return None
            chain = follow_predecessors(predecessors, best)[::-1] // HEADINGS
            of_path = self.graph.moves, chain, limits.known, limits.chassis, limits.scratch
            if looks or find_out_along(self._mesh_map.topology.surface, *of_path):
                return chain, cost
        return None

    def costs_to_states(
        self, query: LegQuery, limits: HeadingLimits, costs: PricedHeadings, start: StartStates
    ) -> Float32Array | None:
        """Cost (V, 16) [m] of the path to each state, inf without one; None if cancelled.

        Moves of which nothing is known count as drivable.
        """
        bound = GoalBound(np.full(len(self._mesh_map.vertices), np.inf, dtype=np.float32), -np.inf, *self._ends(query))
        task = _Task(query, limits, costs, self._weights(query), start, NOWHERE)
        best, _, distances, _ = self._search(task, bound, False)
        return None if best == CANCELLED else distances.reshape(-1, HEADINGS)

    def _weights(self, query: LegQuery) -> Float32Array:
        """Weights (m,) [m] of the moves, kept while the map stays as it is."""
        version, blocked = query.snapshot.version, query.blocked
        if self._kept is None or self._kept[0] != version or not np.array_equal(self._kept[1], blocked):
            self._kept = version, blocked, self.graph.weights(query.snapshot, blocked)
        return self._kept[2]

    def _search(self, task: _Task, bound: GoalBound, looks: bool) -> tuple[int, float, Float32Array, IntArray]:
        """Run the kernel: best target state, its cost, distances and predecessors (16 V,) of the states it came to."""
        mesh_map, query, limits = self._mesh_map, task.query, task.limits
        distances = np.full(HEADINGS * len(mesh_map.vertices), np.inf, dtype=np.float32)
        predecessors = np.full(len(distances), -1, dtype=np.int32)
        seeds, offsets = task.start
        distances[seeds] = offsets
        best, cost = search_with_heading(
            mesh_map.topology.surface,
            self.graph.moves,
            task.weights,
            query.blocked,
            limits.allowed,
            limits.roll,
            task.costs.roll,
            task.costs.turning,
            distances,
            predecessors,
            seeds,
            *task.goal,
            bound,
            limits.known,
            limits.chassis,
            limits.scratch,
            looks,
            np.empty(len(distances), dtype=np.uint64),
            np.full(len(distances), -1, dtype=np.int32),
            query.cancel_flag,
        )
        return best, cost, distances, predecessors

    def _bound(self, task: _Task) -> GoalBound:
        """Spread the wave from the goal to a little behind the start."""
        query, limits, costs = task.query, task.limits, task.costs
        mesh_map, ends, arrivals = self._mesh_map, self._ends(query), self.graph.arrivals
        limited = limits.allowed, limits.roll, costs.roll, limits.known, FORBIDDEN
        backwards = weights_of_arrivals(arrivals, self.graph.moves.headings, task.weights, *limited)
        backwards.setflags(write=False)  # as the weights of a snapshot are
        distances = np.full(len(mesh_map.vertices), np.inf, dtype=np.float32)
        corners, rests, _ = task.goal
        np.minimum.at(distances, corners, rests)
        beyond = BEYOND_START * math.dist(query.start.point, query.goal.point) + costs.turning * TURNS_BEYOND
        states, begun = task.start
        around = (states // HEADINGS).astype(np.int32), begun + np.float32(beyond)
        propagate_distances(
            SearchGraph(arrivals.offsets, arrivals.origins, backwards, query.blocked),
            distances,
            np.full(len(distances), -1, dtype=np.int32),
            np.unique(corners),
            mesh_map.topology.mean_edge_length,
            *around,
            query.cancel_flag,
            ends[:2],
        )
        return GoalBound(distances, float((distances[around[0]] + around[1]).min()), *ends)

    def _ends(self, query: LegQuery) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self._mesh_map.vertices, query.start.point, query.goal.point
