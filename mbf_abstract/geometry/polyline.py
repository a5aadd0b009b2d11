"""Polylines: lengths along them, and which segments of a path are driven backward."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import FloatArray, norm, scalar_products
from mbf_abstract.geometry.path import Path


def polyline_lengths(points: FloatArray) -> FloatArray:
    """(n,) length [m] along a polyline (n, k) from its first point to each point."""
    steps = np.diff(points, axis=0)
    return np.concatenate([[0.0], np.cumsum(norm(steps))])[: len(points)]


def reverse_segments(path: Path, points: FloatArray) -> NDArray[np.bool_]:
    """(n - 1,) bool: which segments lead against the heading of their poses.

    The first and the last pose carry the orientations that were asked for, not the direction of travel: the segments
    there are backward only if their other neighbour is too, or both their poses say so. A path of two poses is driven
    forward.
    """
    count = len(points)
    if count < 3:
        return np.zeros(max(count - 1, 0), dtype=bool)
    assert path.orientations is not None
    x, y, z, w = path.orientations.T
    headings = np.column_stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)])
    headings, steps = headings[:, : points.shape[1]], np.diff(points, axis=0)
    at_start, at_end = scalar_products(steps, headings[:-1]) < -1e-9, scalar_products(steps, headings[1:]) < -1e-9
    reverse = at_start & at_end
    reverse[0] = at_end[0] and (at_start[0] or reverse[1])
    reverse[-1] = at_start[-1] and (at_end[-1] or reverse[-2])
    return reverse
