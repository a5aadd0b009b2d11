"""Polygons in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEAST_AREA = 1e-9
"""[m2]; a polygon with less is a line."""


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


def cross_products(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Third component (...) float64 of the cross products of vectors (..., 2) in ``a`` and ``b``."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def crossing_sides(corners: NDArray[np.float64]) -> tuple[int, int] | None:
    """First two sides of a closed polygon (n, 2), not next to each other, that share a point; None without a pair."""
    count, starts, ends = len(corners), corners, np.roll(corners, -1, axis=0)
    for i in range(count - 2):
        others = np.arange(i + 2, count - 1 if i == 0 else count)
        a, b, c, d = starts[i], ends[i], starts[others], ends[others]
        apart = (cross_products(b - a, c - a) * cross_products(b - a, d - a) > 0.0) | (
            cross_products(d - c, a - c) * cross_products(d - c, b - c) > 0.0
        )
        low, high = np.minimum(c, d), np.maximum(c, d)
        apart |= ((high < np.minimum(a, b)) | (low > np.maximum(a, b))).any(axis=1)
        if not apart.all():
            return i, int(others[int(np.argmin(apart))])
    return None


def area_warning(corners: NDArray[np.float64]) -> str:
    """What of a polygon (n, 2) [m] that marks an area is hardly meant; empty if nothing is."""
    points = corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]
    area = np.add.accumulate(cross_products(points, np.roll(points, -1, axis=0)))
    pair = crossing_sides(points)
    if pair is not None:
        return f"its sides {pair[0]} and {pair[1]} meet: are its corners in order?"
    return "" if len(area) and abs(area[-1]) > LEAST_AREA else "it has no area"
