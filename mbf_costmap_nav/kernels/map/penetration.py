"""How deep an outline lies in what it touches, thing by thing: what a robot in a contact must not increase.

The number of touched cells does not say it: a pole of one cell counts one, from the bumper to the middle of the robot,
and a robot that leaves a wall beside a corner of it may touch more cells of its face, all of them less deep.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel, plain_kernel
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon

FloatArray = NDArray[np.float64]

UNTOUCHED = -np.inf
"""Depth of what is not touched."""


@kernel
def first_deeper(things: NDArray[np.int32], outlines: FloatArray, rounding: float) -> tuple[int, FloatArray]:
    """First of some outlines that lies deeper in a thing than the one at the begin did, or touches another thing.

    A thing that was left must not be touched again.

    Parameters
    ----------
    things : (rows, columns) int32
        Number of the thing that each cell belongs to, 0 where there is none; the outlines lie on this grid.
    outlines : (m, n, 2) float64
        Corners in cell coordinates from place to place of a motion, m and n >= 1. The first is where it begins.
    rounding : float
        How much [cells] deeper counts as no deeper.

    Returns
    -------
    first : int
        From 1 on; m without one.
    deepest : (m,) float64
        Greatest depth [cells] of all things at each of the places up to the first one, ``UNTOUCHED`` after it.
    """
    deepest, none = np.full(len(outlines), UNTOUCHED), np.full(things.max() + 1, UNTOUCHED)
    limits = depths_in(things, outlines[0], none)
    deepest[0] = limits.max()
    for k in range(1, len(outlines)):
        depths = depths_in(things, outlines[k], none)
        deepest[k] = depths.max()
        for number in range(len(limits)):
            if depths[number] > limits[number] + rounding:
                return k, deepest
            if depths[number] == UNTOUCHED:
                limits[number] = UNTOUCHED
    return len(outlines), deepest


@kernel
def depths_in(things: NDArray[np.int32], corners: FloatArray, at_least: FloatArray) -> FloatArray:
    """Depth [cells] of a simple polygon (n, 2) in each thing, but ``at_least`` (things,) so much.

    That of the deepest of its cells that the polygon covers, which is the distance of the cell's centre from the
    nearest side of the polygon, negative for a centre outside of it.
    """
    depths = at_least.copy()
    x0, y0, mask = rasterise_polygon(corners, (0, 0, things.shape[1], things.shape[0]))
    for row in range(mask.shape[0]):
        for column in range(mask.shape[1]):
            number = things[y0 + row, x0 + column]
            if mask[row, column] != 0 and number > 0:
                depths[number] = max(depths[number], _depth(corners, x0 + column + 0.5, y0 + row + 0.5))
    return depths


@plain_kernel
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
