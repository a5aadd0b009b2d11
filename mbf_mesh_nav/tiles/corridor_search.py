"""The search for a plan on a tiled map: coarse over the portals, exact within the tiles that can matter.

1. The portal graph gives two figures for every portal: about what the cheapest path through it costs (the estimate),
   and what all paths through it cost at least (the bound).
2. Portals whose estimate is little above the least one are opened, their tiles loaded, and the exact search along edges
   runs on what is joined by open portals.
3. Every path that was not looked at passes a closed portal. So no path of the whole map costs less than the lesser of
   the found cost and the least bound of the closed portals. If the found cost is within the tolerance of that, it is
   **proven**. If the memory holds all tiles that stand against it, they are loaded, which proves it.
4. Else the corridor is widened until that makes the path no cheaper: the cost is **compared**. The exact search goes on
   from the distances that it left in the narrower corridor, so it visits what is new. Bounds are far too low where
   portals are much longer than edges, as a path along the border of a tile passes from portal to portal for the price
   of an edge; so on large maps costs are compared, not proven. The result states which.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mbf_abstract.outcomes import GetPathOutcome
from mbf_mesh_nav.arrays import BoolArray, FlagArray, Float32Array, IntArray
from mbf_mesh_nav.kernels.search.dijkstra import SearchGraph, follow_predecessors, propagate_distances
from mbf_mesh_nav.mesh.positions import position_text
from mbf_mesh_nav.tiles.places import TilePlace
from mbf_mesh_nav.tiles.portals import PortalGraph, costs_to_portals
from mbf_mesh_nav.tiles.tile import TileKey
from mbf_mesh_nav.tiles.tiled_map import TiledMap
from mbf_mesh_nav.tiles.tiled_plan import TiledPlan, failed_plan, plan_along

FIRST_MARGIN = 0.02
"""How far above the least estimate a portal's may be to be opened at first."""
LEAST_WIDENING = 0.01
"""What is added to twice that margin to widen a corridor."""
EDGES_OF_A_STEP = 16.0
"""Step of the exact search's work lists in mean edges: a corridor has millions of vertices, so the lists are long."""
STEADY = 0.005
"""A corridor is wide enough if a wider one makes the path by no larger a share cheaper."""


@dataclass(frozen=True, eq=False)
class _Corridor:
    """Open portals (P,), their tiles, and whether the memory holds no more of them."""

    is_open: BoolArray
    tiles: tuple[TileKey, ...]
    is_full: bool

    def holds(self, other: _Corridor) -> bool:
        """Whether all open portals of another one are open."""
        return bool(self.is_open[other.is_open].all())


def _cheaper(known: TiledPlan, found: TiledPlan) -> TiledPlan:
    """The cheaper of two plans, with the greater of their bounds, which both hold, and the gain of the one found."""
    plan = known if known.cost < found.cost else found
    return replace(plan, least_cost=min(max(known.least_cost, found.least_cost), plan.cost), gain=found.gain)


def _through(portals: PortalGraph, ends: list[tuple[TileKey, Float32Array]]) -> Float32Array:
    """Costs (P,) [m] from start to goal through every portal."""
    to_start, to_goal = (portals.least_costs([end]) for end in ends)
    return np.asarray(to_start + to_goal)


class CorridorSearch:
    """One search; see the module's text."""

    def __init__(
        self, tiled: TiledMap, start: TilePlace, goal: TilePlace, tolerance: float, cancel_flag: FlagArray
    ) -> None:
        self._tiled, self._start, self._goal = tiled, start, goal
        self._tolerance, self._cancel_flag = tolerance, cancel_flag
        ends = [(place.key, self._to_portals(place)) for place in (start, goal)]
        self._bounds = _through(tiled.portals, ends)
        self._estimates = _through(tiled.estimates, ends)
        self._least_estimate = self._find_least_estimate()
        self._searched: tuple[TileKey, ...] = ()  # tiles with distances that the next exact search goes on from

    def run(self) -> TiledPlan:
        """Widen the corridor until the cost is proven, steady, or nothing more can be opened."""
        ranks, margin = self._estimates, FIRST_MARGIN
        corridor, narrower = self._opened(ranks, self._threshold(margin)), np.inf
        plan = replace(failed_plan(GetPathOutcome.NO_PATH_FOUND, ""), least_cost=0.0)
        while True:
            plan = _cheaper(plan, self._exact(corridor, narrower))
            if self._cancel_flag[0] != 0:
                return failed_plan(GetPathOutcome.CANCELED, "")
            proven = plan.cost <= (1.0 + self._tolerance) * plan.least_cost
            is_last = corridor.is_full or np.isinf(margin)
            if proven or is_last or plan.gain <= STEADY:
                return self._described(plan, proven, corridor.is_full)
            # What stands against a proof comes first, if the memory holds it.
            against = np.asarray(self._bounds <= plan.cost / (1.0 + self._tolerance))
            first = np.where(against, np.float32(0.0), self._estimates)
            if np.isfinite(plan.cost) and not self._opened(first, 0.0).is_full:
                ranks = first
            wider, margin = self._widened(corridor, ranks, margin)
            # The same corridor again, or one without portals of this one for want of memory, is no comparison.
            compares = wider.holds(corridor) and not np.array_equal(wider.is_open, corridor.is_open)
            narrower, self._searched = (plan.cost, corridor.tiles) if compares else (np.inf, ())
            corridor = wider

    def _widened(self, corridor: _Corridor, ranks: Float32Array, margin: float) -> tuple[_Corridor, float]:
        """The next corridor with other portals than this one, or all that the memory holds, and its margin.

        Margins double, so the threshold passes every rank in the end; an infinite margin opens all that can be reached.
        """
        while True:
            margin = 2.0 * margin + LEAST_WIDENING
            wider = self._opened(ranks, self._threshold(margin))
            if wider.is_full or np.isinf(margin) or not np.array_equal(wider.is_open, corridor.is_open):
                return wider, margin

    def _threshold(self, margin: float) -> float:
        """Greatest estimate [m] of an open portal; the least one may be 0, where start and goal are in one portal."""
        return (1.0 + margin) * max(self._least_estimate, self._tiled.index.portal_length)

    def _described(self, plan: TiledPlan, proven: bool, is_full: bool) -> TiledPlan:
        """The result with its outcome and message."""
        held = f"the memory holds {self._tiled.pool.slots} of {len(self._tiled.index.tiles)} tiles"
        text = f"{len(plan.tiles)} tiles"
        if not np.isfinite(plan.cost):
            ends = f"from {position_text(self._start.point)} to {position_text(self._goal.point)}"
            text = f"no free path {ends}" if proven else f"no free path {ends} on {text}; {held}"
            return failed_plan(GetPathOutcome.NO_PATH_FOUND, text, plan.tiles)
        if proven:
            text += f"; proven to be at most {100.0 * plan.gap:.1f} % above the cheapest path of the map"
        elif plan.gain <= STEADY:
            text += f"; not proven, but at most {100.0 * STEADY:g} % cheaper than in a narrower corridor"
        else:
            text += "; neither proven nor compared with a wider corridor"
        return replace(plan, message=f"{text}; {held}" if is_full and not proven else text)

    @property
    def _ends(self) -> tuple[TilePlace, TilePlace]:
        return self._start, self._goal

    def _to_portals(self, place: TilePlace) -> Float32Array:
        """Costs (p,) [m] over a place's own tile to the portals of that tile."""
        tile, seen = self._tiled.tile(place.key)
        seeds = place.corners, place.corner_costs
        return costs_to_portals(seen.graph, tile.shared, tile.portal_of, len(tile.portals), *seeds, seen.threshold_step)

    def _find_least_estimate(self) -> float:
        """The least estimate; within one tile the straight line is one, too."""
        least = float(self._estimates.min(initial=np.inf))
        if self._start.key == self._goal.key:
            difference = self._start.point - self._goal.point
            least = min(least, float(np.sqrt((difference * difference).sum())))
        return least

    def _opened(self, ranks: Float32Array, threshold: float) -> _Corridor:
        """Portals with ranks (P,) up to a threshold and their tiles, those of the least ranks if memory is short."""
        portals, ends = self._tiled.portals, {self._start.key, self._goal.key}
        nearest = {
            key: -1.0 if key in ends else float(ranks[portals.portals_of(key)].min(initial=np.inf))
            for key in self._tiled.index.entries
        }
        ranked = sorted(nearest, key=lambda key: (nearest[key], key))
        wanted = [key for key in ranked if nearest[key] <= threshold and nearest[key] < np.inf]
        slots = self._tiled.pool.slots
        if len(wanted) > slots:  # what passes the first tile left out stays closed
            threshold = min(threshold, float(np.nextafter(np.float32(nearest[wanted[slots]]), np.float32(-np.inf))))
        is_open = np.asarray((ranks <= threshold) & np.isfinite(ranks))
        return _Corridor(is_open, tuple(wanted[:slots]), len(wanted) > slots)

    def _exact(self, corridor: _Corridor, narrower: float) -> TiledPlan:
        """Cheapest path along edges over the tiles of a corridor; ``narrower`` is the cost in the one before [m]."""
        tiled, tiles = self._tiled, corridor.tiles
        tiled.hold(list(tiles))
        graph = tiled.pool.corridor({key: corridor.is_open[tiled.portals.portals_of(key)] for key in tiles})
        closed = float(self._bounds[~corridor.is_open].min(initial=np.inf))
        found = self._cheapest(graph, tiles)
        if found is None:
            return replace(failed_plan(GetPathOutcome.NO_PATH_FOUND, "", tiles), least_cost=closed)
        chain, cost = found
        gain = narrower / cost - 1.0 if np.isfinite(narrower) else np.nan
        plan = plan_along(tiled, chain, self._start, self._goal, cost, min(cost, closed), tiles)
        return replace(plan, gain=gain)

    def _cheapest(self, graph: SearchGraph, tiles: tuple[TileKey, ...]) -> tuple[IntArray, float] | None:
        """Vertices of the pool from start to goal, and the cost [m]; None without a path or if cancelled."""
        pool, (seeds, targets) = self._tiled.pool, (self._in_pool(place) for place in self._ends)
        distances, predecessors = pool.search_arrays(key for key in tiles if key not in self._searched)
        if self._searched:
            seeds = pool.frontier(graph, sorted(self._searched))
        else:
            distances[seeds], predecessors[seeds] = self._start.corner_costs, -1
        vertices = pool.vertices[: len(distances)]
        vertices.flags.writeable = False
        step = EDGES_OF_A_STEP * self._tiled.tile(self._start.key)[1].mean_edge
        offsets = self._goal.corner_costs
        search = graph, distances, predecessors, seeds, step, targets, offsets, self._cancel_flag
        if not propagate_distances(*search, (vertices, self._goal.point)):
            return None
        totals = distances[targets] + offsets
        if not len(totals) or not np.isfinite(totals.min()):
            return None
        return follow_predecessors(predecessors, int(targets[totals.argmin()]))[::-1], float(totals.min())

    def _in_pool(self, place: TilePlace) -> IntArray:
        return (place.corners + self._tiled.pool.first_vertex(place.key)).astype(np.int32)
