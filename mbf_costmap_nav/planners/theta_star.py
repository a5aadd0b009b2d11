"""Theta*: paths of few straight pieces at any angle.

When to use: long straight runs matter (fast robots, smooth heading) and the turning radius does not. When not: the
exact optimum is required (``costmap.astar`` on the eight directions; Theta* is a heuristic, typically within 1 % of
the any-angle optimum and never longer than the octile one), or smooth corners are needed (put ``costmap.smoother``
behind it).

Cost: twice ``costmap.astar``.

Formula: Lazy Theta* (Nash, Koenig, Tovey 2010), see ``kernels.search.theta_star``; lines end after a few cells during
the search and are joined afterwards (``kernels.search.grid_line.pull_string``). ``spacing`` fills the pieces with
poses, as controllers that look only at poses want them.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.kernels.search.grid_line import lines_cost, pull_string
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, FOUND
from mbf_costmap_nav.kernels.search.short_lines import trace_lines
from mbf_costmap_nav.kernels.search.theta_star import new_labels, theta_search
from mbf_costmap_nav.planning.grid_planning import NO_LEG, GridPlanner, Leg
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters, SearchGrid


class ThetaStarParameters(GridPlannerParameters):
    """Parameters of ``costmap.theta_star``."""

    spacing: float = parameter(0.1, "Largest distance of two poses; 0 = corners only.", unit="m", ge=0.0, le=10.0)


class ThetaStarPlanner(GridPlanner):
    """Any-angle planner with goal tolerance and via poses."""

    Parameters: ClassVar[type[PluginParameters]] = ThetaStarParameters
    parameters: ThetaStarParameters

    @property
    def pose_spacing(self) -> float:
        """Fill the straight pieces with poses."""
        return self.parameters.spacing

    def search(self, grid: SearchGrid, start: Pose, goal: Pose, tolerance: float) -> Leg:
        """Search, then shorten by string pulling."""
        goal_cell, source = grid.cell_of(goal), grid.index(grid.cell_of(start))
        last, flag = grid.index(goal_cell), grid.token.flag
        status, g, origin = theta_search(grid.padded, source, last, flag, *grid.memory(new_labels))
        if status == CANCELED:
            return NO_LEG
        end = goal_cell if status == FOUND else grid.nearest_reached(g, goal, tolerance)
        if end is None:
            return NO_LEG
        lines = trace_lines(origin, grid.padded.stride, source, grid.index(end))
        corners = pull_string(grid.padded, lines)
        return Leg(grid.points(corners), path_cost(grid, corners), end == goal_cell)


def path_cost(grid: SearchGrid, corners: NDArray[np.int32]) -> float:
    """Cost [m, weighted] of straight lines between flat padded indices."""
    return float(lines_cost(grid.padded, corners)) * grid.costmap.resolution
