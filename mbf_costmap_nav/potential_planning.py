"""Planning down a potential (navfn's job): spread costs from the goal to the start, then walk downhill.

When to use: by planners whose path follows a field instead of a chain of predecessors. When not: the exact cell path
to one goal, which ``kernels.grid_search.search`` and ``trace_cells`` give with one search from the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid_planning import CANCELED_LEG, NO_LEG, Cell, Leg, SearchGrid
from mbf_costmap_nav.kernels.grid_path import trace_cells, trace_gradient
from mbf_costmap_nav.kernels.grid_search import CANCELED, search


def plan_down_potential(
    grid: SearchGrid,
    start: Cell,
    goal: Pose,
    tolerance: float,
    token: CancelToken,
    *,
    interpolated: bool,
    gradient_path: bool = True,
) -> Leg:
    """Spread from the goal to the start and walk back; a blocked goal is first replaced by the nearest reachable cell.

    Parameters
    ----------
    grid, start, goal, tolerance, token
        As for ``GridPlanner.search``.
    interpolated : bool
        navfn's quadratic update instead of the cost of eight-connected steps.
    gradient_path : bool
        Descend the gradient; otherwise go from cell to cell.
    """
    end: Cell | None = grid.costmap.world_to_cell_clamped(goal.x, goal.y)
    reached_goal = True
    assert end is not None
    g = _spread(grid, end, start, interpolated, token) if not grid.is_blocked(end) else None
    if g is None or np.isinf(g[grid.index(start)]):
        if token.cancelled:
            return CANCELED_LEG
        from_start = _spread(grid, start, None, interpolated, token)
        end = grid.nearest_reached(from_start, goal, tolerance) if from_start is not None else None
        reached_goal = False
        g = _spread(grid, end, start, interpolated, token) if end is not None else None
    if token.cancelled:
        return CANCELED_LEG
    if g is None:
        return NO_LEG
    source = grid.index(start)
    cost = float(g[source]) * grid.costmap.resolution
    if not gradient_path:
        cells = trace_cells(grid.cells, grid.stride, grid.table, g, source, False)
        return Leg(grid.points(cells), cost, reached_goal)
    points = trace_gradient(grid.cells, grid.stride, grid.table, g, source) - 1.0
    return Leg(grid.costmap.cells_to_world(points), cost, reached_goal)


def _spread(
    grid: SearchGrid, source: Cell, until: Cell | None, interpolated: bool, token: CancelToken
) -> NDArray[np.float32] | None:
    """Field from ``source`` up to ``until``, or everywhere; None when cancelled."""
    first, last = grid.index(source), -1 if until is None else grid.index(until)
    status, g = search(grid.cells, grid.stride, grid.table, first, last, 0.0, False, interpolated, token.flag)
    return None if status == CANCELED else g
