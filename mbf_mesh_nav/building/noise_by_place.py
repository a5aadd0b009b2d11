"""The noise of the points around each place of a survey: blades of grass are noise where grass stands.

One number for all points would call grass a disagreement about the ground, which it is not: the mean of a cell averages
blades as it averages the noise of a scanner. The median of many cells is used, which a boulder does not change.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.building.surface_patches import SurfacePatches
from mbf_mesh_nav.kernels.building.disagreement import BINS, distance_histograms

BLOCK = 5
"""Cells along a block. A place sees its block and the eight around it: of a usual built map, 3 m and 900 points."""
BINS_IN_MEDIAN = 32
"""Bins up to the median of all distances, so that a median of a place is known within a sixtieth of that."""
LEAST_POINTS = 100
"""Points from which the median of a place counts, and not that of all points."""


def medians_by_place(patches: SurfacePatches, distances: NDArray[np.float32], used: BoolArray) -> FloatArray:
    """Medians (P,) [m] of the absolute distances of the points around each patch from the faces.

    Parameters
    ----------
    distances : (n,) float32
        Of the points [m], at least one of them a number; NaN for points of no face.
    used : (P,) bool
        Patches that are vertices, whose points count.
    """
    usual = float(np.nanmedian(np.abs(distances)))
    width = usual / BINS_IN_MEDIAN
    if width == 0.0:
        return np.zeros(len(patches.cells))
    columns, rows = patches.cells % patches.grid.columns, patches.cells // patches.grid.columns
    across = patches.grid.columns // BLOCK + 3  # a column of blocks is left free on either side
    numbers = (rows // BLOCK + 1).astype(np.int64) * across + columns // BLOCK + 1
    known, block_of = np.unique(numbers, return_inverse=True)
    arrays = (distances, patches.firsts, patches.ends, used, block_of.astype(np.int32))
    counts = distance_histograms(*arrays, len(known), width)
    return _medians(_summed_around(counts, known, across), width, usual)[block_of]


def _summed_around(counts: IntArray, known: NDArray[np.int64], across: int) -> NDArray[np.int64]:
    """Histograms (B, bins) of blocks together with the eight around each, of those with sorted numbers (B,)."""
    result = np.zeros(counts.shape, dtype=np.int64)
    for step in (down * across + right for down in (-1, 0, 1) for right in (-1, 0, 1)):
        at = np.minimum(np.searchsorted(known, known + step), len(known) - 1)
        found = known[at] == known + step
        result[found] += counts[at[found]]
    return result


def _medians(counts: NDArray[np.int64], width: float, usual: float) -> FloatArray:
    """Middle of the bin that holds the median of each histogram (B, bins); the usual one where points are few."""
    totals = counts.sum(axis=1)
    reached = np.cumsum(counts, axis=1) >= 0.5 * totals[:, None]
    medians = (np.argmax(reached, axis=1) + 0.5) * width
    return np.asarray(np.where((totals < LEAST_POINTS) | ~reached[:, BINS - 2], usual, medians))
