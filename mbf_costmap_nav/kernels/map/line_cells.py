"""The highest cost a straight line between any two points runs through, every cell of it looked at.

When to use: ends that lie anywhere in their cells, and "may it be driven at all". When not: the weighted length of a
line from centre to centre, which ``grid_line.line_cost`` integrates.

Formula: Amanatides and Woo 1987. A line through the corner of four cells also counts one of the two beside it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, plain_kernel
from mbf_costmap_nav.kernels.costs import LETHAL, UNKNOWN

OUTSIDE_COST = LETHAL
"""What lies off the map counts as lethal."""


@inner_kernel
def _cost_of_cell(cells: NDArray[np.uint8], unknown: int, ix: int, iy: int) -> int:
    """Cost of a cell; ``unknown`` for one that is UNKNOWN."""
    if ix < 0 or iy < 0 or ix >= cells.shape[1] or iy >= cells.shape[0]:
        return OUTSIDE_COST
    return int(cells[iy, ix]) if cells[iy, ix] < UNKNOWN else unknown


@plain_kernel
def cost_along(cells: NDArray[np.uint8], unknown: int, x0: float, y0: float, x1: float, y1: float) -> int:
    """Highest cost of the cells that a line runs through.

    Parameters
    ----------
    cells : (height, width) uint8
    unknown : int
        What an unknown cell counts as, 0 .. 254.
    x0, y0, x1, y1 : float
        Ends in cell units (cell (ix, iy) spans ix .. ix + 1).
    """
    ix, iy, last_x, last_y = math.floor(x0), math.floor(y0), math.floor(x1), math.floor(y1)
    highest = _cost_of_cell(cells, unknown, ix, iy)
    dx, dy = x1 - x0, y1 - y0
    step_x, step_y = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
    # The share of the line at which it crosses the next border on each axis.
    next_x = ((ix + (dx > 0.0)) - x0) / dx if dx != 0.0 else math.inf
    next_y = ((iy + (dy > 0.0)) - y0) / dy if dy != 0.0 else math.inf
    for _ in range(abs(last_x - ix) + abs(last_y - iy)):
        if next_x < next_y:
            ix += step_x
            next_x += abs(1.0 / dx)
        else:
            iy += step_y
            next_y += abs(1.0 / dy)
        highest = max(highest, _cost_of_cell(cells, unknown, ix, iy))
    return highest
