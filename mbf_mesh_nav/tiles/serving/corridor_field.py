"""Distances to one goal over the tiles of a corridor, kept from plan to plan: a local change costs its shadow only.

The first plan to a goal is searched (``corridor_search``), and the distances from the goal to all vertices of the tiles
it looked at are computed. From then on a plan repairs them where sensed costs have changed, as ``mesh.repairing`` does
on one mesh, and traces the path from where the robot is by then.

What the search has shown of its corridor has to hold still. A plan is searched anew if it leads to another goal or may
cost less above the cheapest, if it begins a portal's length or more beside the last path, if a tile has changed or left
the memory, if sensed costs have changed outside of the corridor, and once changes have made the path dearer by more
than two corridors may differ by, or by more than the tolerance where that is less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.outcomes import GetPathOutcome
from mbf_mesh_nav.arrays import FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, follow_predecessors, propagate_distances
from mbf_mesh_nav.kernels.search.repair_wave import invalidate_subtrees
from mbf_mesh_nav.search.leg_search import NO_OFFSETS, NO_TARGETS
from mbf_mesh_nav.tiles.corridor_search import STEADY
from mbf_mesh_nav.tiles.places import TilePlace
from mbf_mesh_nav.tiles.planning import plan_between
from mbf_mesh_nav.tiles.sensed import SensedCosts
from mbf_mesh_nav.tiles.tile import TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap
from mbf_mesh_nav.tiles.tiled_plan import TiledPlan, plan_along


@dataclass(eq=False)
class _Field:
    """Distances (V,) [m] of the pool's vertices to a goal, the next vertices on the path, and what they are of.

    ``risen`` is by how much changes have raised the costs of the plans since the search [m], ``tolerance`` is that
    of the search.
    """

    goal: TilePlace
    tolerance: float
    roots: IntArray
    distances: Float32Array
    predecessors: IntArray
    firsts: dict[TileKey, int]
    sensed: SensedCosts
    changes: int
    searched_cost: float
    path: TiledPlan
    risen: float = 0.0


class CorridorField:
    """What is kept of the last goal; takes one thread at a time, as ``tiled`` does.

    Raises
    ------
    MeshError
        The map's memory does not hold a field beside two tiles.
    """

    def __init__(self, tiled: TiledMap) -> None:
        tiled.make_room_for_field()
        self._tiled = tiled
        self._field: _Field | None = None

    def forget(self) -> None:
        """Search the next plan."""
        self._field = None

    def plan(self, start: TilePlace, goal: TilePlace, tolerance: float, cancel_flag: FlagArray) -> TiledPlan:
        """Plan between two places as ``plan_between``, by repair where that is as good."""
        field, self._field = self._field, None  # a cancelled repair leaves no half-finished field behind
        plan = None if field is None else self._repaired(field, start, goal, tolerance, cancel_flag)
        if plan is not None:
            self._field = field
            return plan
        plan = plan_between(self._tiled, start, goal, tolerance=tolerance, cancel_flag=cancel_flag)
        if plan.outcome == GetPathOutcome.SUCCESS and plan.tiles:
            self._field = self._new(plan, goal, tolerance, cancel_flag)
        return plan

    def _new(self, plan: TiledPlan, goal: TilePlace, tolerance: float, cancel_flag: FlagArray) -> _Field | None:
        """The field of a plan that was searched just now; None if it is cancelled."""
        self._tiled.hold(list(plan.tiles))  # a wider corridor than that of the plan may have taken their places
        graph, firsts = self._graph(plan.tiles), self._firsts(plan.tiles)
        distances = np.full(len(graph.blocked), np.inf, dtype=np.float32)
        predecessors = np.full(len(graph.blocked), -1, dtype=np.int32)
        roots = (goal.corners + firsts[goal.key]).astype(np.int32)
        distances[roots] = goal.corner_costs
        arrays = roots, distances, predecessors, firsts
        field = _Field(goal, tolerance, *arrays, self._tiled.sensed, self._tiled.changes, plan.cost, plan)
        return field if self._spread(field, graph, roots, cancel_flag) else None

    def _repaired(
        self, field: _Field, start: TilePlace, goal: TilePlace, tolerance: float, cancel_flag: FlagArray
    ) -> TiledPlan | None:
        """The path on the repaired field; None where it has to be searched anew."""
        # 1. Does it lead to the same goal, from beside the last path, over tiles that are as they were?
        if tolerance < field.tolerance or not self._still_holds(field, start, goal):
            return None
        tiles, numbers = field.path.tiles, field.sensed.differing(self._tiled.sensed)
        if len(tiles) > self._tiled.pool.slots:  # another planner's field has taken room since
            return None
        self._tiled.hold(list(tiles))
        changed = self._tiled.vertices_in_pool(numbers, tiles, (field.sensed.box, self._tiled.sensed.box))
        graph = self._graph(tiles)
        in_place = self._firsts(tiles) == field.firsts and len(graph.blocked) == len(field.distances)
        if changed is None or not in_place:
            return None
        # 2. Repair the field.
        before = _cost_from(field, start)
        arrays = graph, field.distances, field.predecessors, field.roots, goal.corner_costs
        seeds = invalidate_subtrees(*arrays, changed)
        # Copies of a shared vertex are linked in a circle: one may be intact and no neighbour of those that were reset.
        seeds = np.union1d(seeds, self._beside_reset_copies(field, tiles)).astype(np.int32)
        if not self._spread(field, graph, seeds, cancel_flag):
            return None
        field.sensed = self._tiled.sensed
        # 3. Has the path become so much dearer that another corridor may be better?
        cost = _cost_from(field, start)
        field.risen += max(0.0, cost - before) if np.isfinite(before) else np.inf
        if not np.isfinite(cost) or field.risen > min(STEADY, tolerance) * field.searched_cost:
            return None
        field.path = self._traced(field, start, cost, len(numbers))
        return field.path

    def _still_holds(self, field: _Field, start: TilePlace, goal: TilePlace) -> bool:
        known = field.goal
        same_goal = (known.key, known.face) == (goal.key, goal.face) and np.array_equal(known.point, goal.point)
        same_roots = np.array_equal(known.corners, goal.corners) and np.array_equal(
            known.corner_costs, goal.corner_costs
        )
        if not (same_goal and same_roots) or field.changes != self._tiled.changes or start.key not in field.firsts:
            return False
        in_one_face = (start.key, start.face) == (goal.key, goal.face)
        beside = float(norm(field.path.positions - start.point).min())
        return not in_one_face and beside < self._tiled.index.portal_length

    def _graph(self, tiles: tuple[TileKey, ...]) -> SearchGraph:
        """The loaded tiles of a corridor, joined at all of their portals."""
        portals = self._tiled.portals
        is_open = {key: np.ones(len(portals.portals_of(key)), dtype=np.bool_) for key in tiles}
        return self._tiled.pool.corridor(is_open)

    def _firsts(self, tiles: tuple[TileKey, ...]) -> dict[TileKey, int]:
        return {key: self._tiled.pool.first_vertex(key) for key in tiles}

    def _spread(self, field: _Field, graph: SearchGraph, seeds: IntArray, cancel_flag: FlagArray) -> bool:
        """Relax the field from some vertices until nothing improves; False if cancelled."""
        step = self._tiled.tile(field.goal.key)[1].threshold_step
        arrays = graph, field.distances, field.predecessors, seeds, step, NO_TARGETS, NO_OFFSETS, cancel_flag
        return bool(propagate_distances(*arrays))

    def _beside_reset_copies(self, field: _Field, tiles: tuple[TileKey, ...]) -> IntArray:
        """Reached vertices (n,) that other tiles share, and there have no distance."""
        number, vertex = self._tiled.pool.shared(tiles)
        reached = np.isfinite(field.distances[vertex])
        _, group = np.unique(number, return_inverse=True)
        missing = np.zeros(len(number), dtype=np.bool_)
        missing[group[~reached]] = True
        return vertex[reached & missing[group]].astype(np.int32)

    def _traced(self, field: _Field, start: TilePlace, cost: float, changed: int) -> TiledPlan:
        corners = start.corners + field.firsts[start.key]
        first = int(corners[(field.distances[corners] + start.corner_costs).argmin()])
        chain, tiles = follow_predecessors(field.predecessors, first), field.path.tiles
        straight = float(norm(start.point - field.goal.point))
        plan = plan_along(self._tiled, chain, start, field.goal, cost, straight, tiles)
        return replace(plan, message=f"{len(tiles)} tiles; repaired where {changed} vertices have changed")


def _cost_from(field: _Field, start: TilePlace) -> float:
    """Cost [m] of the path from a place; inf without one."""
    corners = start.corners + field.firsts[start.key]
    return float((field.distances[corners] + start.corner_costs).min(initial=np.inf))
