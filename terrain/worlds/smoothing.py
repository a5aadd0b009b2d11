"""Gaussian smoothing of heights with the same bytes on every CPU.

``scipy.ndimage.gaussian_filter`` does the same but takes its weights from numpy's ``exp``, which is other code on CPUs
with AVX-512.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import exp

REACH = 4.0  # standard deviations at which the weights end


def smoothed(heights: FloatArray, sigma: tuple[float, float]) -> FloatArray:
    """Heights (ny, nx) after a Gaussian filter; beyond the border the outermost heights go on.

    Parameters
    ----------
    sigma : (float, float)
        Standard deviations along y and x [samples].
    """
    for axis, deviation in enumerate(sigma):
        radius = int(REACH * deviation + 0.5)
        weights = exp(-0.5 * (np.arange(-radius, radius + 1) / deviation) ** 2)
        heights = ndimage.correlate1d(heights, weights / weights.sum(), axis=axis, mode="nearest")
    return heights
