"""Dijkstra's field from the goal, and the path down its gradient (navfn's job).

When to use: where a smooth path is wanted without a smoother. When not: one far goal on a huge map, where
``costmap.astar`` settles far fewer cells.

The field is exact for the eight neighbours; navfn's quadratic update is not used, so the potential is up to 8 %
above the Euclidean distance in open space, and the descent of its interpolated gradient takes most of that back.
``gradient_path: false`` gives the exact 8-connected path instead.

Cost: about 15 ns per cell of the whole free space nearer than the start.

Formula: Dijkstra 1959; gradient descent as in navfn (Brock and Khatib 1999) with bilinear interpolation.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_costmap_nav.grid_planning import (
    CANCELED_LEG,
    NO_LEG,
    Cell,
    GridPlanner,
    GridPlannerParameters,
    Leg,
    SearchGrid,
)
from mbf_costmap_nav.kernels.grid_path import trace_cells, trace_gradient
from mbf_costmap_nav.kernels.grid_search import CANCELED, search


class DijkstraParameters(GridPlannerParameters):
    """Parameters of ``costmap.dijkstra``."""

    gradient_path: bool = parameter(True, "Follow the interpolated gradient instead of the eight directions.")


class DijkstraPlanner(GridPlanner):
    """Full-width search with a gradient path."""

    Parameters: ClassVar[type[PluginParameters]] = DijkstraParameters
    parameters: DijkstraParameters

    def search(self, grid: SearchGrid, start: Cell, goal: Pose, tolerance: float, token: CancelToken) -> Leg:
        """Spread from the goal to the start; a blocked goal is first replaced by the nearest reachable cell."""
        end: Cell | None = grid.costmap.world_to_cell_clamped(goal.x, goal.y)
        reached_goal = True
        assert end is not None
        g = self._spread(grid, end, start, token) if not grid.is_blocked(end) else None
        if g is None or np.isinf(g[grid.index(start)]):
            if token.cancelled:
                return CANCELED_LEG
            from_start = self._spread(grid, start, None, token)
            end = grid.nearest_reached(from_start, goal, tolerance) if from_start is not None else None
            reached_goal = False
            g = self._spread(grid, end, start, token) if end is not None else None
        if token.cancelled:
            return CANCELED_LEG
        if g is None:
            return NO_LEG
        source = grid.index(start)
        cost = float(g[source]) * grid.costmap.resolution
        if not self.parameters.gradient_path:
            return Leg(
                grid.points(trace_cells(grid.cells, grid.stride, grid.table, g, source, False)), cost, reached_goal
            )
        cells = trace_gradient(grid.cells, grid.stride, grid.table, g, source) - 1.0
        return Leg(grid.costmap.cells_to_world(cells), cost, reached_goal)

    def _spread(
        self, grid: SearchGrid, source: Cell, until: Cell | None, token: CancelToken
    ) -> NDArray[np.float32] | None:
        """Field from ``source`` up to ``until``, or everywhere; None when cancelled."""
        last = -1 if until is None else grid.index(until)
        status, g = search(grid.cells, grid.stride, grid.table, grid.index(source), last, 0.0, False, token.flag)
        return None if status == CANCELED else g
