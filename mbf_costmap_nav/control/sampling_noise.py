"""The noise that MPPI adds to its velocities, and the filter that smooths their mean in time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]

SMOOTHING = np.array([-21.0, 14.0, 39.0, 54.0, 59.0, 54.0, 39.0, 14.0, -21.0]) / 231.0
"""Savitzky-Golay filter of 9 points, quadratic (Savitzky and Golay 1964, table I)."""


def smoothing_matrix(steps: int) -> Float32Array:
    """(steps, steps) matrix that takes a row of controls through the filter, the first and the last one held."""
    reach = len(SMOOTHING) // 2
    matrix = np.zeros((steps, steps), dtype=np.float32)
    for offset, weight in enumerate(SMOOTHING, start=-reach):
        np.add.at(matrix, (np.clip(np.arange(steps) + offset, 0, steps - 1), np.arange(steps)), weight)
    return matrix


def correlated_noise(rng: np.random.Generator, shape: tuple[int, int, int, int], correlation: float) -> Float32Array:
    """Unit normal noise (sets, components, steps, samples) whose steps follow each other as an AR(1) process."""
    noise = rng.standard_normal(shape, dtype=np.float32)
    fresh = math.sqrt(1.0 - correlation * correlation)
    for t in range(1, shape[2]):
        noise[:, :, t] = correlation * noise[:, :, t - 1] + fresh * noise[:, :, t]
    return noise
