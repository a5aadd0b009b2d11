"""The worst cells under an outline that moves along a line: all that it touches on the way, not those at samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import Count, kernel
from mbf_costmap_nav.kernels.costs import (
    INSCRIBED,
    INSCRIBED_STATE,
    LETHAL,
    LETHAL_STATE,
    OUTSIDE_STATE,
    UNKNOWN,
    UNKNOWN_STATE,
)
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon

FloatArray = NDArray[np.float64]

FAR = 1 << 40


@kernel
def swept_states(cells: NDArray[np.uint8], outline: FloatArray, points: FloatArray) -> NDArray[np.int64]:
    """Worst states of the cells that an outline touches on each line of a path, looking along it.

    What a polygon sweeps on a line are its two ends and a parallelogram for each of its sides.

    Parameters
    ----------
    cells : (height, width) uint8
    outline : (m, 2) float64
        Corners in the robot's frame, in cells, m >= 1.
    points : (n, 2) float64
        Of the path, in cell coordinates.

    Returns
    -------
    (n - 1, 2) int64
        Worst ``CellState``, where the end of the map is OUTSIDE, and the worst one of what is known on the map. Lines
        without a length are FREE.
    """
    lines, corners = len(points) - 1, len(outline)
    states = np.zeros((lines, 2), dtype=np.int64)
    begin, end, swept = np.empty((corners, 2)), np.empty((corners, 2)), np.empty((4, 2))
    for line in range(lines):
        dx, dy = points[line + 1, 0] - points[line, 0], points[line + 1, 1] - points[line, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        c, s = dx / length, dy / length
        for i in range(corners):
            begin[i, 0] = points[line, 0] + c * outline[i, 0] - s * outline[i, 1]
            begin[i, 1] = points[line, 1] + s * outline[i, 0] + c * outline[i, 1]
            end[i, 0], end[i, 1] = begin[i, 0] + dx, begin[i, 1] + dy
        _add_states(cells, begin, states, Count(line))
        _add_states(cells, end, states, Count(line))
        for i in range(corners):
            j = i + 1 if i + 1 < corners else 0
            for axis in range(2):
                swept[0, axis], swept[1, axis] = begin[i, axis], begin[j, axis]
                swept[2, axis], swept[3, axis] = end[j, axis], end[i, axis]
            _add_states(cells, swept, states, Count(line))
    return states


@kernel
def _add_states(cells: NDArray[np.uint8], corners: FloatArray, states: NDArray[np.int64], line: int) -> None:
    """Raise the states of a line to those of the cells under a polygon."""
    height, width = cells.shape
    x0, y0, mask = rasterise_polygon(corners, (-FAR, -FAR, FAR, FAR))
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            if mask[row, column] == 0:
                continue
            ix, iy = x0 + column, y0 + row
            if ix < 0 or iy < 0 or ix >= width or iy >= height:
                states[line, 0] = OUTSIDE_STATE
                continue
            cost = cells[iy, ix]
            if cost == UNKNOWN:
                states[line, 0] = max(states[line, 0], UNKNOWN_STATE)
            elif cost >= INSCRIBED:
                state = LETHAL_STATE if cost == LETHAL else INSCRIBED_STATE
                states[line, 0], states[line, 1] = max(states[line, 0], state), max(states[line, 1], state)
