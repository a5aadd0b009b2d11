"""Smoothing with weights of our own is scipy's Gaussian filter."""

import numpy as np
import pytest
from scipy import ndimage

from terrain.worlds.smoothing import smoothed


@pytest.mark.parametrize("sigma", [(0.4, 0.4), (1.5, 3.0), (6.0, 2.0)])
def test_smoothing_is_a_gaussian_filter_whose_outermost_heights_go_on(sigma):
    heights = np.random.default_rng(1).normal(size=(17, 23))
    expected = ndimage.gaussian_filter(heights, sigma, mode="nearest")
    assert smoothed(heights, sigma) == pytest.approx(expected, abs=1e-12)
