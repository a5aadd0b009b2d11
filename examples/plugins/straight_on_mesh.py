"""Planner `straight_on_mesh`: straight over the surface, from pose to pose, and no search.

When to use: short paths over open ground. When not: anything must be driven around; it answers NO_PATH_FOUND.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.plugins import MeshPlanner


class StraightOnMeshParameters(PluginParameters):
    """Parameters of `straight_on_mesh`."""

    spacing: float = parameter(0.1, "Distance of two poses.", unit="m", gt=0.0, le=10.0)
    max_distance: float = parameter(1.0, "How far the surface may be from the straight line.", unit="m", gt=0.0)


class StraightOnMesh(MeshPlanner):
    """Drops a straight line onto the surface and checks the vertices below it."""

    Parameters = StraightOnMeshParameters
    parameters: StraightOnMeshParameters

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Connect start, via poses and goal; NO_PATH_FOUND where a vertex below is lethal."""
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        stops = [np.array(pose.position) for pose in (request.start, *request.via, request.goal)]
        legs = [np.linspace(a, b, 2 + int(np.linalg.norm(b - a) / self.parameters.spacing)) for a, b in pairwise(stops)]
        below = self.mesh_map.locate(np.concatenate(legs), self.parameters.max_distance)
        if (below.faces < 0).any():
            return PlanResult(GetPathOutcome.OUT_OF_MAP, "the straight line leaves the surface")
        lethal = self.mesh_map.snapshot().lethal[self.mesh_map.faces[below.faces]].any(axis=1)
        if lethal.any():
            x, y, z = below.points[lethal][0]
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, f"lethal ground at ({x:.2f}, {y:.2f}, {z:.2f})")
        normals = self.mesh_map.face_normals[below.faces]
        path = Path.from_points(below.points, request.goal.orientation, normals, self.mesh_map.frame_id)
        return PlanResult(GetPathOutcome.SUCCESS, "straight", path)
