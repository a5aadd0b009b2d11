"""Where the middle of an object is, measured from the sides of its cluster.

A scan shows only the near side of an object. So its size is remembered, and its middle is measured from the side that
faces the sensor: the middle stays where it is while more or less of the far side comes into view. Where one of two
sides is occluded, see ``occlusion.py``, the middle is measured from the other one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_abstract.maps.tracking.kernels.clustering import GREATEST, LEAST, NEITHER

FloatArray = NDArray[np.float64]


@kernel
def middle_of(least: float, greatest: float, half: float, sensor: float, free: float) -> float:
    """Middle [m] along one axis of a thing of half size ``half`` seen from ``least`` to ``greatest`` by a sensor.

    It is measured from the ``free`` side, if only one is, else from the side that faces the sensor.
    """
    if free == LEAST or (free == NEITHER and sensor < least):
        return least + half
    if free == GREATEST or (free == NEITHER and sensor > greatest):
        return greatest - half
    return 0.5 * (least + greatest)


@kernel
def measure(
    state: FloatArray,
    columns: tuple[int, int, int, int],
    least: float,
    greatest: float,
    sensor: float,
    free: float,
    shrink: float,
) -> float:
    """How far [m] a middle is seen off its place along one axis, whose ``columns`` are place, size, anchor and side.

    The half size is remembered; the middle that moves with it, or is measured from another side, is no motion.
    """
    position, size, anchor, side = columns
    half = max(0.5 * (greatest - least), state[size] - shrink)
    seen = middle_of(least, greatest, half, sensor, free)
    moved = seen - middle_of(least, greatest, state[size], sensor, state[side])
    state[size], state[side] = half, free
    state[position] += moved
    state[anchor] += moved
    return float(seen - state[position])
