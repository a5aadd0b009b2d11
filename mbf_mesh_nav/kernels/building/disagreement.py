"""How far the points around a surface patch are from its faces, for the error of its height."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.compiled import kernel

SQUARES, POINTS, PATCHES, INVERSES = 0, 1, 2, 3
"""Columns of ``sums_around``."""
BINS = 256
"""Of a histogram of distances."""


@kernel
def sums_around(
    distances: NDArray[np.float32], firsts: NDArray[np.int64], ends: NDArray[np.int64], links: IntArray, used: BoolArray
) -> FloatArray:
    """Sums (P, 4) over a patch and the used patches linked to it.

    They are those of the squared distances of the points from the faces [m2], the number of these points, the number of
    patches that have such points, and the inverse of the number of each of those.

    Parameters
    ----------
    distances : (n,) float32
        Of the points [m], sorted as the patches number them; NaN for points of no face.
    firsts, ends, links
        As in ``SurfacePatches``.
    used : (P,) bool
        Patches that are vertices of faces.
    """
    count = firsts.shape[0]
    own = np.zeros((count, 4), dtype=np.float64)
    for patch in range(count):
        if not used[patch]:
            continue
        for position in range(firsts[patch], ends[patch]):
            distance = float(distances[position])
            if not np.isnan(distance):
                own[patch, SQUARES] += distance * distance
                own[patch, POINTS] += 1.0
        if own[patch, POINTS] > 0.0:
            own[patch, PATCHES], own[patch, INVERSES] = 1.0, 1.0 / own[patch, POINTS]
    sums = own.copy()
    for patch in range(count):
        for direction in range(links.shape[1]):
            other = links[patch, direction]
            if other >= 0:
                for column in range(4):
                    sums[patch, column] += own[other, column]
    return sums


@kernel
def distance_histograms(
    distances: NDArray[np.float32],
    firsts: NDArray[np.int64],
    ends: NDArray[np.int64],
    used: BoolArray,
    blocks: IntArray,
    block_count: int,
    width: float,
) -> IntArray:
    """Histograms (block_count, BINS) of the absolute distances of the points of used patches, by the patches' blocks.

    Parameters
    ----------
    distances, firsts, ends, used
        As in ``sums_around``.
    blocks : (P,) int32
        The block of each patch.
    width : float
        Of a bin [m]; the last one holds what is farther.
    """
    counts = np.zeros((block_count, BINS), dtype=np.int32)
    for patch in range(firsts.shape[0]):
        if not used[patch]:
            continue
        for position in range(firsts[patch], ends[patch]):
            distance = abs(float(distances[position]))
            if not np.isnan(distance):
                counts[blocks[patch], int(min(distance / width, BINS - 1.0))] += 1
    return counts
