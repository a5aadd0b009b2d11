"""The straight line from start to goal, if it is free; no search.

When to use: docking and other last metres that must not wander, tests, and as a first try before a search. When not:
anything between start and goal that must be driven around; it answers NO_PATH_FOUND.

Cost: microseconds. With a goal tolerance the line may end at its last free cell within the tolerance.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.grid_planning import NO_LEG, Cell, GridPlanner, GridPlannerParameters, Leg, SearchGrid
from mbf_costmap_nav.kernels.grid_line import line_cost
from mbf_costmap_nav.path_geometry import resample


class StraightLineParameters(GridPlannerParameters):
    """Parameters of ``costmap.straight_line``."""

    spacing: float = parameter(0.1, "Largest distance of two poses.", unit="m", gt=0.0, le=10.0)


class StraightLinePlanner(GridPlanner):
    """Plans a straight line or nothing."""

    Parameters: ClassVar[type[PluginParameters]] = StraightLineParameters
    parameters: StraightLineParameters

    @property
    def pose_spacing(self) -> float:
        """Fill the line with poses."""
        return self.parameters.spacing

    def search(self, grid: SearchGrid, start: Cell, goal: Pose, tolerance: float, token: CancelToken) -> Leg:
        """Try the goal's cell, then the cells before it on the line, as far back as the tolerance reaches."""
        source = grid.index(start)
        ends = np.array([grid.costmap.cell_to_world(*start), (goal.x, goal.y)])
        line = resample(ends, min(self.parameters.spacing, grid.costmap.resolution))
        for x, y in line[::-1].tolist():
            off = math.hypot(goal.x - x, goal.y - y)
            if off > tolerance and off > 0.0:
                break
            cell = grid.costmap.world_to_cell_clamped(x, y)
            cost = float(line_cost(grid.cells, grid.stride, grid.table, source, grid.index(cell)))
            if math.isfinite(cost):
                return Leg(np.array([ends[0], (x, y)]), cost * grid.costmap.resolution, off == 0.0)
        return NO_LEG
