"""A* over the eight neighbours of a cell: the exact cheapest grid path, fast.

When to use: the default. It settles only the cells that could lie on a better path and finds the same cost as
``costmap.dijkstra``. When not: the path turns in steps of 45 degrees (``theta_star`` or a smoother give straight
lines), and it ignores the robot's turning radius (``hybrid_astar``).

Cost: about 20 ns per settled cell; across 1000 x 1000 cells in some 7 ms.

``interpolated_potential`` propagates navfn's potential from the goal and follows its gradient from the start, as
navfn's A* does. Unlike there no cell is ever dropped, so a path is found wherever there is one, and the propagation
uses no heuristic: values are exact only in ascending order, and a heuristic was measured to save no time.

Formula: Hart, Nilsson, Raphael 1968 with the octile distance as heuristic; the open list is a ring of buckets, see
``kernels.search.grid_search``.
"""

from __future__ import annotations

from typing import ClassVar

from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.kernels.search.grid_path import trace_cells
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, FOUND, new_search_memory, search
from mbf_costmap_nav.planning.grid_planning import NO_LEG, GridPlanner, Leg
from mbf_costmap_nav.planning.potential_planning import plan_down_potential
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters, SearchGrid


class AStarParameters(GridPlannerParameters):
    """Parameters of ``costmap.astar``."""

    cut_corners: bool = parameter(False, "Allow a diagonal step that touches a blocked cell at its side.")
    interpolated_potential: bool = parameter(False, "Follow the gradient of navfn's potential; corners are not cut.")


class AStarPlanner(GridPlanner):
    """Exact 8-connected A* with goal tolerance and via poses."""

    Parameters: ClassVar[type[PluginParameters]] = AStarParameters
    parameters: AStarParameters

    def search(self, grid: SearchGrid, start: Pose, goal: Pose, tolerance: float) -> Leg:
        """Search from the start; if the goal is not reached, the nearest reachable cell is taken."""
        if self.parameters.interpolated_potential:
            return plan_down_potential(grid, start, goal, tolerance, interpolated=True)
        cut, goal_cell = self.parameters.cut_corners, grid.cell_of(goal)
        first, last, flag = grid.index(grid.cell_of(start)), grid.index(goal_cell), grid.token.flag
        (records, buckets), touched = grid.memory(new_search_memory)
        status, g, path = search(grid.padded, first, last, 1.0, cut, False, flag, records, touched, buckets)
        if status == CANCELED:
            return NO_LEG
        if status != FOUND:
            end = grid.nearest_reached(g, goal, tolerance)
            if end is None:
                return NO_LEG
            path = trace_cells(grid.padded, g, grid.index(end), cut)[::-1]
        cost = float(g[path[-1]]) * grid.costmap.resolution
        return Leg(grid.points(path), cost, status == FOUND)
