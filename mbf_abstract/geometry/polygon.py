"""Polygons in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def inside_polygon(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of points whose x, y lie in a closed polygon, by the even-odd rule; on the outline either may result.

    Parameters
    ----------
    points : (n, 2) or (n, 3) float64
    corners : (m, 2) or (m, 3) float64
        In order, the first one not repeated at the end.
    """
    x, y = points[:, 0], points[:, 1]
    inside = np.zeros(len(points), dtype=np.bool_)
    with np.errstate(over="ignore"):  # of an edge that rises by next to nothing, between whose ends nothing lies
        for (x1, y1), (x2, y2) in zip(corners[:, :2], np.roll(corners[:, :2], -1, axis=0), strict=True):
            spans = (y1 > y) != (y2 > y)
            rise = y2 - y1 if y2 != y1 else 1.0
            inside ^= spans & (x < x1 + (y - y1) * (x2 - x1) / rise)
    return inside
