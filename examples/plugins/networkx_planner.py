"""A planner by networkx on the mesh's vertex graph: a few lines for trying an idea.

When to use: experiments with graph algorithms. When not: on a robot; it is some hundred times slower than `mesh.astar`
and checks its cancel token only before the search.
"""

from __future__ import annotations

from itertools import pairwise

import networkx
import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.mesh.vertex_graph import vertex_names
from mbf_mesh_nav.plugins import MeshPlanner

MAX_DISTANCE = 1.0  # m; how far a pose may be from the surface


class NetworkxPlanner(MeshPlanner):
    """Cheapest path along edges by ``networkx.shortest_path``; lethal edges are not in the graph."""

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Search from the corner next to the start to the corner next to the goal; via poses in between."""
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        poses = (request.start, *request.via, request.goal)
        below = self.mesh_map.locate([pose.position for pose in poses], MAX_DISTANCE)
        if (below.faces < 0).any():
            return PlanResult(GetPathOutcome.OUT_OF_MAP, f"no surface within {MAX_DISTANCE:g} m of a pose")
        graph, names = self.mesh_map.vertex_graph(), vertex_names(self.mesh_map.topology)
        corners = self.mesh_map.faces[below.faces]
        stops = names[corners[np.arange(len(poses)), below.barycentric.argmax(axis=1)]].tolist()
        nodes = stops[:1]
        for start, end in pairwise(stops):
            try:
                nodes += networkx.shortest_path(graph, start, end, weight="weight")[1:]
            except networkx.NetworkXNoPath as error:
                return PlanResult(GetPathOutcome.NO_PATH_FOUND, str(error))
        points = [graph.nodes[node]["position"] for node in nodes]
        return PlanResult(GetPathOutcome.SUCCESS, "along edges", Path.from_points(points, request.goal.orientation))
