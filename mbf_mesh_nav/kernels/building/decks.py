"""The upper layers of runs of points: what lies on top, thin, above a gap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray
from mbf_mesh_nav.kernels.compiled import kernel

SHARE = 0.2
"""The upper side of a layer has at least so many of the points of its run."""


class TopLayers(NamedTuple):
    """The upper sides of runs of points.

    Attributes
    ----------
    firsts : (P,) int64
        First point of the upper side, which is as thick as a band below the highest point.
    bottoms, tops : (P,) float64
        Mean heights of the points in a band above the lowest point, and of the upper side [m].
    is_deck : (P,) bool
        Whether a layer with this upper side lies above a gap and is thin.
    """

    firsts: NDArray[np.int64]
    bottoms: FloatArray
    tops: FloatArray
    is_deck: BoolArray


@kernel
def top_layers(
    points: FloatArray, firsts: NDArray[np.int64], ends: NDArray[np.int64], band: float, thickest: float, tallest: float
) -> TopLayers:
    """Upper sides of runs of points (n, 3), each sorted by height.

    A layer is at most ``thickest`` [m], the gap below it at least a ``band``; a run is ``tallest`` [m] at most, as one
    that is taller has a patch of its own for its upper end.
    """
    count = firsts.shape[0]
    begins, bottoms, tops = np.empty(count, dtype=np.int64), np.empty(count), np.empty(count)
    is_deck = np.zeros(count, dtype=np.bool_)
    for run in range(count):
        first, end = firsts[run], ends[run]
        low, high = points[first, 2], points[end - 1, 2]
        begin, below, above, behind = end, 0.0, 0.0, first
        while begin > first and points[begin - 1, 2] >= high - band:
            begin -= 1
            above += points[begin, 2]
        while behind < end and points[behind, 2] <= low + band:
            below += points[behind, 2]
            behind += 1
        begins[run], bottoms[run], tops[run] = begin, below / (behind - first), above / (end - begin)
        if high - low <= tallest and end - begin >= SHARE * (end - first):
            for position in range(begin, first, -1):
                if points[position, 2] < high - thickest:
                    break
                if points[position, 2] - points[position - 1, 2] >= band:
                    is_deck[run] = True
    return TopLayers(begins, bottoms, tops, is_deck)
