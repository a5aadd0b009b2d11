"""A planner of one's own for ``mbf bench``: straight over the ground, whatever is in the way.

PYTHONPATH=examples mbf bench outdoor --planner straight_planner:StraightPlanner
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_mesh_nav.plugins import MeshPlanner


class StraightPlanner(MeshPlanner):
    """Projects the straight line from start to goal onto the mesh."""

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Answer at once."""
        start, goal = np.array(request.start.position), np.array(request.goal.position)
        points = np.linspace(start, goal, max(2, int(np.hypot(*(goal - start)[:2]) / 0.2)))
        for _ in range(20):  # the nearest surface point of the nearest surface point ... is straight below
            points[:, 2] = self.mesh_map.locate(points, np.inf).points[:, 2]
        return PlanResult(GetPathOutcome.SUCCESS, "straight ahead", Path.from_points(points, request.goal.orientation))
