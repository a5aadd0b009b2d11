"""The straight line from start to goal, if it is free; no search.

When to use: docking and other final approaches that must be straight, tests, and before a search. When not:
anything between start and goal that must be driven around; it answers NO_PATH_FOUND.

Cost: microseconds. With a goal tolerance the line may end at its last free cell within the tolerance.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.control.path_geometry import resample
from mbf_costmap_nav.planning.grid_planning import NO_LEG, GridPlanner, Leg
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters, SearchGrid

SAMPLES_PER_CELL = 10
"""Samples per cell length for the cost of a line."""


class StraightLineParameters(GridPlannerParameters):
    """Parameters of ``costmap.straight_line``."""

    spacing: float = parameter(0.1, "Largest distance of two poses.", unit="m", gt=0.0, le=10.0)


class StraightLinePlanner(GridPlanner):
    """Plans a straight line or nothing."""

    Parameters: ClassVar[type[PluginParameters]] = StraightLineParameters
    parameters: StraightLineParameters
    plans_manoeuvres: ClassVar[bool] = False

    @property
    def pose_spacing(self) -> float:
        """Fill the line with poses."""
        return self.parameters.spacing

    def search(self, grid: SearchGrid, start: Pose, goal: Pose, tolerance: float) -> Leg:
        """Go along the line as far as it is free; that must be the goal, or within the tolerance of it."""
        ends = np.array([[start.x, start.y], [goal.x, goal.y]])
        if grid.is_free_line(*ends):
            return Leg(ends, _weighted_length(grid, ends))
        if tolerance == 0.0:
            return NO_LEG
        line = resample(ends, min(self.parameters.spacing, grid.costmap.resolution))
        last_free = next(i for i, (a, b) in enumerate(pairwise(line)) if not grid.is_free_line(a, b))
        if math.dist(line[last_free], ends[1]) > tolerance:
            return NO_LEG
        ends = line[[0, last_free]]
        return Leg(ends, _weighted_length(grid, ends), reached_goal=False)


def _weighted_length(grid: SearchGrid, ends: NDArray[np.float64]) -> float:
    """Cost [m, weighted] of the free line between two points (2, 2) [m]."""
    samples = resample(ends, grid.costmap.resolution / SAMPLES_PER_CELL)
    cells, _ = grid.costmap.world_to_cells(0.5 * (samples[1:] + samples[:-1]))
    traversal = grid.padded.table[grid.costmap.cells[cells[:, 1], cells[:, 0]]]
    return float(np.mean(traversal, dtype=np.float64)) * math.dist(ends[0], ends[1])
