"""Planner `straight_on_costmap`: straight over the costmap, from pose to pose, and no search.

When to use: short paths over open ground. When not: anything must be driven around; it answers NO_PATH_FOUND.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mbf_abstract.geometry import Path
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_costmap_nav.grid.costmap import INSCRIBED
from mbf_costmap_nav.plugins import CostmapPlanner


class StraightOnCostmapParameters(PluginParameters):
    """Parameters of `straight_on_costmap`."""

    spacing: float = parameter(0.05, "Distance of two poses; at most the side of a cell.", unit="m", gt=0.0)


class StraightOnCostmap(CostmapPlanner):
    """Checks the cells below a straight line."""

    Parameters = StraightOnCostmapParameters
    parameters: StraightOnCostmapParameters

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Connect start, via poses and goal; NO_PATH_FOUND where a cell is inscribed, lethal or unknown."""
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        stops = [np.array(pose.position) for pose in (request.start, *request.via, request.goal)]
        legs = [np.linspace(a, b, 2 + int(np.linalg.norm(b - a) / self.parameters.spacing)) for a, b in pairwise(stops)]
        points = np.concatenate(legs)
        costmap = self.costmap.snapshot()
        cells, inside = costmap.world_to_cells(points)
        if not inside.all():
            return PlanResult(GetPathOutcome.OUT_OF_MAP, "the straight line leaves the map")
        blocked = costmap.cells[cells[:, 1], cells[:, 0]] >= INSCRIBED
        if blocked.any():
            x, y, _ = points[blocked][0]
            return PlanResult(GetPathOutcome.NO_PATH_FOUND, f"blocked at ({x:.2f}, {y:.2f})")
        path = Path.from_points(points, request.goal.orientation, frame_id=costmap.frame_id)
        return PlanResult(GetPathOutcome.SUCCESS, "straight", path)
