"""The inverse model of a sensor with a wide cone, written into a grid of occupancy probabilities.

Within the cone the belief of the echo falls off with the angle (quadratically) and with the distance (a smooth step at
``fade_distance``), after costmap_2d's range sensor layer. One deviation: the width of the band around the measured
distance is one cell, where the original multiplies the distance by the resolution.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import plain_kernel

FADE_DISTANCE = 1.2
"""Distance [m] at which the belief in a reading is halved."""
LEAST_PROBABILITY = 0.02
"""Beliefs stay this far from certainty, so that later readings can still change them."""


@plain_kernel
def occupied_given_reading(distance: float, angle: float, reading: float, half_angle: float, band: float) -> float:
    """Probability that a cell at (distance [m], angle [rad]) is occupied when the sensor reads ``reading`` [m].

    Free before the reading, occupied in a band of +-``band`` [m] around it, unknown (0.5) behind.
    """
    off_axis = max(0.0, 1.0 - (angle / half_angle) ** 2)
    belief = off_axis * (1.0 - (1.0 + math.tanh(2.0 * (distance - FADE_DISTANCE))) / 2.0)
    if distance < reading - 2.0 * band:
        return (1.0 - belief) * 0.5
    if distance < reading - band:
        return belief * 0.5 * ((distance - (reading - 2.0 * band)) / band) ** 2 + (1.0 - belief) * 0.5
    if distance < reading + band:
        return belief * (0.5 - 0.5 * ((reading - distance) / band) ** 2) + 0.5
    return 0.5


@plain_kernel
def update_cone(
    probability: NDArray[np.float32],
    lower_left: NDArray[np.float64],
    resolution: float,
    sensor: NDArray[np.float64],
    end: NDArray[np.float64],
    half_angle: float,
    clear: bool,
) -> tuple[int, int, int, int]:
    """Take one reading into the grid.

    Parameters
    ----------
    probability : (height, width) float32
        Belief that a cell is occupied, in (0, 1).
    lower_left : (2,) float64
        Origin of the grid [m].
    resolution : float
        Side of a cell [m].
    sensor, end : (3,) float64
        Sensor, and point on its axis at the measured distance [m]; z is ignored.
    half_angle : float
        Half of the field of view [rad].
    clear : bool
        Nothing was seen: free the whole cone.

    Returns
    -------
    (x0, y0, x1, y1) : int
        Half-open box of cells that may have changed; on the grid, perhaps empty.
    """
    height, width = probability.shape
    reading = math.hypot(end[0] - sensor[0], end[1] - sensor[1])
    axis_x, axis_y = end[0] - sensor[0], end[1] - sensor[1]
    reach = reading if clear else reading + resolution
    x0 = max(0, int((sensor[0] - reach - lower_left[0]) / resolution))
    y0 = max(0, int((sensor[1] - reach - lower_left[1]) / resolution))
    x1 = min(width, int((sensor[0] + reach - lower_left[0]) / resolution) + 1)
    y1 = min(height, int((sensor[1] + reach - lower_left[1]) / resolution) + 1)
    for iy in range(y0, y1):
        for ix in range(x0, x1):
            dx = lower_left[0] + (ix + 0.5) * resolution - sensor[0]
            dy = lower_left[1] + (iy + 0.5) * resolution - sensor[1]
            distance = math.hypot(dx, dy)
            # The cell in whose middle the sensor sits has no direction but rounding's: it counts as straight ahead.
            on_sensor = distance < 1e-6 * resolution
            angle = 0.0 if on_sensor else math.atan2(axis_x * dy - axis_y * dx, axis_x * dx + axis_y * dy)
            if clear:
                # A cell belongs to the cone if the cone passes within half a cell's diagonal of its centre.
                beside = distance * math.sin(min(max(0.0, abs(angle) - half_angle), math.pi / 2))
                if distance <= reach and beside <= 0.71 * resolution:
                    probability[iy, ix] = LEAST_PROBABILITY
                continue
            measured = occupied_given_reading(distance, angle, reading, half_angle, resolution)
            prior = probability[iy, ix]
            occupied, free = measured * prior, (1.0 - measured) * (1.0 - prior)
            posterior = occupied / (occupied + free)
            probability[iy, ix] = min(1.0 - LEAST_PROBABILITY, max(LEAST_PROBABILITY, posterior))
    return x0, y0, max(x0, x1), max(y0, y1)
