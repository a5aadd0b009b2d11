"""The ground under a car: where its footprint fits, and what the centre's cell costs there.

When to use: thousands of poses of one footprint on one snapshot (``hybrid_astar``). When not: one pose or a few, for
which ``pose_cost`` alone is enough.

Most poses are far from obstacles, which a look-up of a few cells proves: the ``discs`` cover the footprint, and no
lethal cell is near the centre of any. The footprint samples are looked at only where one of these cells is ``tight``.
A pose costs more where a somewhat larger outline does not fit: controllers keep to no path exactly, so none leads along
a wall without a millimetre to spare if there is room to the other side.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, plain_kernel
from mbf_costmap_nav.kernels.costs import INSCRIBED, LETHAL, UNKNOWN
from mbf_costmap_nav.kernels.map.footprint_cost import footprint_cost
from mbf_costmap_nav.kernels.map.inflation import LARGEST_RADIUS, inflate
from mbf_costmap_nav.kernels.map.line_cells import cost_along

FloatArray = NDArray[np.float64]

CELL_DIAGONAL = 1.415
"""Two points are as near as the centres of their cells, give or take half a diagonal [cells] for each."""
CLOSE_COST = 126
"""What a pose costs more for each of the larger outlines that does not fit."""
GOLDEN_RATIO = 0.6180339887498949
NO_SAMPLES = np.zeros((0, 2))


class Ground(NamedTuple):
    """A snapshot and the footprint on it.

    Attributes
    ----------
    cells : (height, width) uint8
    unknown : int
        Cost that an unknown cell under the centre counts as; 254 to keep out of them.
    geometry : (resolution, origin_x, origin_y)
        [m].
    samples : (n, 2) float64
        Footprint samples in the base frame [m], neighbours far apart so that a collision shows early.
    larger, slightly_larger : (m, 2) float64
        Samples of outlines with some room to spare, and with less; none = room costs nothing.
    discs : (k, 2) float64
        Centres [m] of the discs that cover all samples.
    tight : (height, width) uint8
        0 where a disc lies on the map and off lethal cells.
    """

    cells: NDArray[np.uint8]
    unknown: int
    geometry: FloatArray
    samples: FloatArray
    larger: FloatArray
    slightly_larger: FloatArray
    discs: FloatArray
    tight: NDArray[np.uint8]


def ground_of(
    cells: NDArray[np.uint8],
    unknown: int,
    geometry: FloatArray,
    samples: FloatArray,
    larger: FloatArray = NO_SAMPLES,
    slightly_larger: FloatArray = NO_SAMPLES,
) -> Ground:
    """Prepare a snapshot for footprint samples (n, 2) [m]; the arguments are those of ``Ground``."""
    covered = np.concatenate([samples, larger, slightly_larger])
    discs = _disc_centres(covered)
    gaps = np.hypot(covered[:, None, 0] - discs[None, :, 0], covered[:, None, 1] - discs[None, :, 1])
    radius = min(LARGEST_RADIUS, math.ceil(gaps.min(axis=1).max() / geometry[0] + CELL_DIAGONAL))
    tight = np.zeros_like(cells)
    if radius == LARGEST_RADIUS:
        tight[:] = 1  # a robot of hundreds of cells: all its samples are looked at
    height, width = cells.shape
    seeds = (cells == LETHAL).astype(np.uint8)
    inflate(tight, seeds, (0, 0, width, height), np.ones(radius * radius + 1, dtype=np.uint8), radius, 1)
    for border in (tight[:radius], tight[-radius:], tight[:, :radius], tight[:, -radius:]):
        border[:] = 1
    shown = cells.view()
    shown.flags.writeable = False  # as a snapshot's are: another type for numba, and all kernels compiled for both
    outlines = _far_apart(samples), _far_apart(larger), _far_apart(slightly_larger)
    return Ground(shown, unknown, geometry, *outlines, discs, tight)


def _far_apart(samples: FloatArray) -> FloatArray:
    """The samples in an order in which neighbours are far apart."""
    return np.ascontiguousarray(samples[np.argsort((np.arange(len(samples)) * GOLDEN_RATIO) % 1.0, kind="stable")])


def _disc_centres(samples: FloatArray) -> FloatArray:
    """Centres (k, 2) of equal discs in a row along the longer side of the samples' box, two for each square."""
    low, high = samples.min(axis=0), samples.max(axis=0)
    extent = high - low
    along = int(np.argmax(extent))
    count = min(16, 2 * math.ceil(extent[along] / max(extent[1 - along], 0.1 * extent[along]))) if extent[along] else 1
    centres = np.tile(0.5 * (low + high), (count, 1))
    centres[:, along] = low[along] + (np.arange(count) + 0.5) * extent[along] / count
    return centres


@plain_kernel
def pose_cost(
    cells: NDArray[np.uint8], unknown: int, geometry: FloatArray, samples: FloatArray, pose: FloatArray
) -> int:
    """Cost of the centre's cell at a pose (x, y, yaw), or -1 if the robot does not fit there.

    ``geometry`` is (resolution, origin_x, origin_y); a centre in an unknown cell counts as ``unknown``.
    """
    cost = _centre_cost(cells, unknown, geometry, pose)
    if cost < 0:
        return -1
    return cost if _fits(cells, geometry, samples, pose) else -1


@plain_kernel
def _fits(cells: NDArray[np.uint8], geometry: FloatArray, samples: FloatArray, pose: FloatArray) -> bool:
    worst = footprint_cost(cells, geometry[0], geometry[1], geometry[2], samples, pose[0], pose[1], pose[2])
    return bool(0 <= worst < LETHAL or worst == UNKNOWN)


@inner_kernel
def _centre_cost(cells: NDArray[np.uint8], unknown: int, geometry: FloatArray, pose: FloatArray) -> int:
    ix = int(np.floor((pose[0] - geometry[1]) / geometry[0]))
    iy = int(np.floor((pose[1] - geometry[2]) / geometry[0]))
    if ix < 0 or iy < 0 or ix >= cells.shape[1] or iy >= cells.shape[0]:
        return -1
    cost = int(cells[iy, ix]) if cells[iy, ix] < UNKNOWN else unknown
    return cost if cost < INSCRIBED else -1


@plain_kernel
def fitting_cost(ground: Ground, pose: FloatArray) -> int:
    """``pose_cost`` on the ground, faster far from obstacles; with ``CLOSE_COST`` where larger outlines do not fit."""
    geometry = ground.geometry
    cost = _centre_cost(ground.cells, ground.unknown, geometry, pose)
    if cost < 0:
        return -1
    x, y = (pose[0] - geometry[1]) / geometry[0], (pose[1] - geometry[2]) / geometry[0]
    c, s = np.cos(pose[2]) / geometry[0], np.sin(pose[2]) / geometry[0]
    height, width = ground.cells.shape
    for i in range(ground.discs.shape[0]):
        forward, left = ground.discs[i, 0], ground.discs[i, 1]
        ix, iy = int(np.floor(x + c * forward - s * left)), int(np.floor(y + s * forward + c * left))
        if ix < 0 or iy < 0 or ix >= width or iy >= height or ground.tight[iy, ix] != 0:
            if not _fits(ground.cells, geometry, ground.samples, pose):
                return -1
            if not _fits(ground.cells, geometry, ground.slightly_larger, pose):
                return cost + 2 * CLOSE_COST
            return cost if _fits(ground.cells, geometry, ground.larger, pose) else cost + CLOSE_COST
    return cost


@plain_kernel
def driven_cost(ground: Ground, start: FloatArray, poses: FloatArray) -> float:
    """Mean cost of the centre over poses (n, 3) that are driven one after the other from ``start``, or -1.

    -1: the robot does not fit at one of them, or its centre crosses a blocked cell before it. 0 without poses.
    """
    total, geometry = 0.0, ground.geometry
    x, y = (start[0] - geometry[1]) / geometry[0], (start[1] - geometry[2]) / geometry[0]
    for i in range(poses.shape[0]):
        x_next, y_next = (poses[i, 0] - geometry[1]) / geometry[0], (poses[i, 1] - geometry[2]) / geometry[0]
        cost = fitting_cost(ground, poses[i])
        if cost < 0:
            return -1.0
        cells_apart = abs(np.floor(x_next) - np.floor(x)) + abs(np.floor(y_next) - np.floor(y))
        if cells_apart > 1.0 and cost_along(ground.cells, ground.unknown, x, y, x_next, y_next) >= INSCRIBED:
            return -1.0
        total += cost
        x, y = x_next, y_next
    return float(total / max(1, poses.shape[0]))
