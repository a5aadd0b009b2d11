"""A planner by networkx on the mesh's vertex graph: a few lines for trying an idea.

When to use: experiments with graph algorithms. When not: on a robot; it is some hundred times slower than `mesh.astar`
and looks at its cancel token only before the search.
"""

from __future__ import annotations

from itertools import pairwise

import networkx
import numpy as np

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.plugins import MeshPlanner


class NetworkxPlanner(MeshPlanner):
    """Cheapest way along edges by ``networkx.shortest_path``; lethal edges are not in the graph."""

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Search from the vertex next to the start to the vertex next to the goal; via poses in between."""
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        graph = self.mesh_map.vertex_graph()
        stops = [self._nearest_vertex(pose) for pose in (request.start, *request.via, request.goal)]
        nodes = stops[:1]
        for start, end in pairwise(stops):
            try:
                nodes += networkx.shortest_path(graph, start, end, weight="weight")[1:]
            except networkx.NetworkXNoPath as error:
                return PlanResult(GetPathOutcome.NO_PATH_FOUND, str(error))
        points = [graph.nodes[node]["position"] for node in nodes]
        return PlanResult(GetPathOutcome.SUCCESS, "along edges", Path.from_points(points, request.goal.orientation))

    def _nearest_vertex(self, pose: Pose) -> int:
        """Number, in the graph, of the nearest corner of the face below the pose."""
        face = self.mesh_map.locate([pose.position]).faces[0]
        corners = self.mesh_map.faces[face]
        distances = np.linalg.norm(self.mesh_map.vertices[corners] - pose.position, axis=1)
        return int(self.mesh_map.internal_to_input[corners[distances.argmin()]])
