"""How deep lethal cells lie within a polygon: what a robot that touches something must not increase.

The number of touched cells does not say it: a pole of one cell counts one, from the bumper to the middle of the robot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_costmap_nav.kernels.compiled import kernel

FloatArray = NDArray[np.float64]

NOT_NEAR = -1.0
"""Depth where no lethal cell is as near as a cell."""


@kernel
def penetration(cells: NDArray[np.uint8], corners: FloatArray) -> float:
    """Greatest depth of the centre of a lethal cell within a simple polygon, as its distance from the nearest side.

    Parameters
    ----------
    cells : (height, width) uint8
    corners : (n, 2) float64
        Corners in cell coordinates, n >= 1. One corner is a point, two are a segment.

    Returns
    -------
    float
        In cells; negative for a centre outside of the polygon, ``NOT_NEAR`` at the least.
    """
    height, width = cells.shape
    left, low = corners[0, 0], corners[0, 1]
    right, high = left, low
    for i in range(1, len(corners)):
        left, right = min(left, corners[i, 0]), max(right, corners[i, 0])
        low, high = min(low, corners[i, 1]), max(high, corners[i, 1])
    deepest = NOT_NEAR
    for row in range(max(0, int(np.floor(low)) - 1), min(height, int(np.floor(high)) + 2)):
        for column in range(max(0, int(np.floor(left)) - 1), min(width, int(np.floor(right)) + 2)):
            if cells[row, column] == 254:
                deepest = max(deepest, _depth(corners, column + 0.5, row + 0.5))
    return deepest


@kernel
def _depth(corners: FloatArray, x: float, y: float) -> float:
    """Distance of a point from the nearest side, negative outside of the polygon."""
    nearest, inside = np.inf, False
    for i in range(len(corners)):
        j = i + 1 if i + 1 < len(corners) else 0
        ax, ay = corners[i, 0] - x, corners[i, 1] - y
        bx, by = corners[j, 0] - x, corners[j, 1] - y
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        share = min(max(-(ax * dx + ay * dy) / length, 0.0), 1.0) if length > 0.0 else 0.0
        px, py = ax + share * dx, ay + share * dy
        nearest = min(nearest, px * px + py * py)
        if (ay > 0.0) != (by > 0.0) and (ax * dy > ay * dx) == (dy > 0.0):
            inside = not inside
    distance = float(np.sqrt(nearest))
    return distance if inside else -distance
