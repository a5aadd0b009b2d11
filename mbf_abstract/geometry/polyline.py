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


def places_between(
    points: FloatArray, spacing: float, longer_than: float = 0.0
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Places (k, d) between the points (n, d) of a polyline, at most ``spacing`` [m] apart, and the point before each.

    Segments that are not longer than ``longer_than`` [m] have none, nor have those not longer than ``spacing``.
    """
    lengths = np.diff(polyline_lengths(points))
    counts = np.ceil(lengths / spacing - 1e-9).astype(np.int64).clip(1)
    counts[lengths <= longer_than] = 1
    segments = np.repeat(np.arange(len(counts)), counts - 1)
    firsts = np.cumsum(counts - 1) - (counts - 1)
    shares = (np.arange(len(segments)) - firsts[segments] + 1.0) / counts[segments]
    return points[segments] + shares[:, None] * (points[segments + 1] - points[segments]), segments


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
