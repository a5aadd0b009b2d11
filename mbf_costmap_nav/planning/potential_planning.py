"""Planning down a potential (navfn's job): propagate costs from the goal to the start, then descend.

When to use: by planners whose path follows a field instead of a chain of predecessors. When not: the exact cell path
to one goal, which ``kernels.search.grid_search.search`` and ``trace_cells`` give with one search from the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.kernels.search.grid_path import trace_cells, trace_gradient
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, new_search_memory, search
from mbf_costmap_nav.planning.grid_planning import NO_LEG, Leg
from mbf_costmap_nav.planning.search_grid import Cell, SearchGrid


def plan_down_potential(
    grid: SearchGrid, start: Pose, goal: Pose, tolerance: float, *, interpolated: bool, gradient_path: bool = True
) -> Leg:
    """Propagate from the goal to the start and descend; a blocked goal is first replaced by the nearest reachable cell.

    Parameters
    ----------
    grid, start, goal, tolerance
        As for ``GridPlanner.search``.
    interpolated : bool
        navfn's quadratic update instead of the cost of eight-connected steps.
    gradient_path : bool
        Descend the gradient; otherwise go from cell to cell.
    """
    source, end = grid.index(grid.cell_of(start)), grid.cell_of(goal)
    reached_goal = True
    g = _propagate(grid, end, source, interpolated) if not grid.is_blocked(end) else None
    if not grid.token.cancelled and (g is None or np.isinf(g[source])):
        g, reached_goal = _from_nearest_end(grid, start, goal, tolerance, interpolated), False
    if g is None:
        return NO_LEG
    cost = float(g[source]) * grid.costmap.resolution
    if not gradient_path:
        cells = trace_cells(grid.padded, g, source, False)
        return Leg(grid.points(cells), cost, reached_goal)
    points = trace_gradient(grid.padded, g, source) - 1.0
    return Leg(grid.costmap.cells_to_world(points), cost, reached_goal)


def _from_nearest_end(
    grid: SearchGrid, start: Pose, goal: Pose, tolerance: float, interpolated: bool
) -> NDArray[np.float32] | None:
    """Field up to the start from the reachable cell nearest to the goal; None without one, or when cancelled."""
    from_start = _propagate(grid, grid.cell_of(start), -1, interpolated)
    end = None if from_start is None else grid.nearest_reached(from_start, goal, tolerance)
    return None if end is None else _propagate(grid, end, grid.index(grid.cell_of(start)), interpolated)


def _propagate(grid: SearchGrid, source: Cell, until: int, interpolated: bool) -> NDArray[np.float32] | None:
    """Field from ``source`` up to the padded index ``until``, or everywhere for -1; None when cancelled."""
    first, flag = grid.index(source), grid.token.flag
    (records, buckets), touched = grid.memory(new_search_memory)
    status, g, _ = search(grid.padded, first, until, 0.0, False, interpolated, flag, records, touched, buckets)
    return None if status == CANCELED else g
