"""Dijkstra's search over the free nodes of a ``GraphMap``, by via points to the goal or within its tolerance.

When to use: the graph of a backend of your own. When not: paths between the directions of the edges; on a grid of eight
directions they are up to 8 % longer. Cost: 10 to 20 ms for 10,000 nodes a leg; a cancel takes effect between legs.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbf_abstract.geometry import FloatArray, Path, Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.goals.arrival_tolerance import ends_beside, not_even_beside
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.maps.graph.graph_map import BoolArray, GraphMap
from mbf_abstract.maps.map_plugin import MapContext, MapPlugin
from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import AbstractPlanner, PlanRequest, PlanResult

OFF_GROUND = 0.5
"""A pose farther above or below the ground [m] is not on it."""


class GraphPlanner(MapPlugin, AbstractPlanner):
    """Finds the cheapest path over the graph; costs lengthen its edges."""

    map_type = GraphMap

    def __init__(self, context: MapContext[GraphMap]) -> None:
        super().__init__(context)
        self._map = context.navigation_map

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Search leg by leg."""
        free = self._map.free_nodes()
        stops = (request.start, *request.via, request.goal)
        names = ("start", *(f"via pose {number}" for number in range(1, len(stops) - 1)), "goal")
        ends = [self._ends(pose, request.dist_tolerance if pose is request.goal else 0.0, free) for pose in stops]
        for pose, nodes, name in zip(stops, ends, names, strict=True):
            if not len(nodes):
                return not_even_beside(self._refused(pose, name), request.dist_tolerance * (name == "goal"))
        graph, here = self._graph(free), int(ends[0][0])
        chain, cost = [here], 0.0
        for targets, name in zip(ends[1:], names[1:], strict=True):
            if request.cancel_token.cancelled:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            costs, before = _dijkstra(graph, here)
            reached = targets[np.isfinite(costs[targets])]
            if not len(reached):
                unreachable = PlanResult(GetPathOutcome.NO_PATH_FOUND, f"start and {name} are not connected")
                return not_even_beside(unreachable, request.dist_tolerance * (name == "goal"))
            leg, here = [int(reached[0])], int(reached[0])
            cost += float(costs[here])
            while leg[-1] != chain[-1]:
                leg.append(int(before[leg[-1]]))
            chain += leg[-2::-1]
        path = self._path(chain, request)
        text, off = f"{path.length:.2f} m over {len(chain)} nodes", path[-1].distance_to(request.goal)
        if chain[-1] != self._map.node_at(request.goal.x, request.goal.y):
            text += f", {ends_beside(off, request.dist_tolerance)}"
        return PlanResult(GetPathOutcome.SUCCESS, text, path, cost)

    def _ends(self, pose: Pose, tolerance: float, free: BoolArray) -> Any:
        """Free nodes at a pose: the nearest one, then the others within the tolerance [m] in order of distance."""
        own = self._map.node_at(pose.x, pose.y)
        on_ground = own >= 0 and abs(pose.z - self._map.nodes[own, 2]) <= OFF_GROUND
        itself = np.array([own] if on_ground and free[own] else [], dtype=np.intp)
        if tolerance == 0.0:
            return itself
        gaps = norm(self._map.nodes - np.asarray(pose.position))
        near = np.flatnonzero(free & (gaps <= tolerance))
        return np.concatenate([itself, near[np.argsort(gaps[near], kind="stable")]])

    def _refused(self, pose: Pose, name: str) -> PlanResult:
        answer, node = self._map.place(pose.x, pose.y), self._map.node_at(pose.x, pose.y)
        place = f"the {name} ({pose.x:.2f}, {pose.y:.2f})"
        if node < 0:
            return PlanResult(GetPathOutcome.OUT_OF_MAP, f"there is no ground at {place}")
        if answer.state is CellState.FREE:
            height = float(self._map.nodes[node, 2])
            text = f"{place} is {abs(pose.z - height):.2f} m from the ground, which is at z = {height:.2f} m"
            return PlanResult(GetPathOutcome.OUT_OF_MAP, f"{text}; allowed are {OFF_GROUND:g} m")
        text = f"{place} is {answer.state.name}, cost {answer.cost:.2f}"
        if name != "start":
            return PlanResult(GetPathOutcome.BLOCKED_GOAL, text)
        return PlanResult(GetPathOutcome.BLOCKED_START, f"{text}; {getting_free(self._map, pose)}")

    def _graph(self, free: BoolArray) -> Any:
        """Sparse matrix of what an edge between free nodes costs: its length, longer by the costs."""
        from scipy.sparse import csr_array  # slow to import

        nodes, costs = self._map.nodes, self._map.state.costs
        start, end = self._map.edges[free[self._map.edges].all(axis=1)].T
        lengths = norm(nodes[end] - nodes[start]) * (1.0 + 0.5 * (costs[start] + costs[end]))
        return csr_array((lengths, (start, end)), shape=(len(nodes), len(nodes)))

    def _path(self, chain: list[int], request: PlanRequest) -> Path:
        """Path over nodes; it ends exactly at start and goal where these lie at its end nodes."""
        points: FloatArray = self._map.nodes[chain].copy()
        if chain[-1] == self._map.node_at(request.goal.x, request.goal.y):
            points[-1, :2] = request.goal.x, request.goal.y
        if len(points) > 1:
            points[0, :2] = request.start.x, request.start.y
        return Path.from_points(points, request.goal.orientation, frame_id=self._map.frame_id)


def _dijkstra(graph: Any, start: int) -> tuple[FloatArray, Any]:
    """Costs (n,) from a node, and the node before each (n,)."""
    from scipy.sparse.csgraph import dijkstra

    costs, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    return np.asarray(costs, dtype=np.float64), before
