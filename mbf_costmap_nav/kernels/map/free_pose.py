"""Poses at which a footprint fits: the nearest one, and which of many do."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.costs import (
    FREE_FIT,
    FREE_STATE,
    INSCRIBED,
    INSCRIBED_STATE,
    LETHAL,
    LETHAL_STATE,
    OUTSIDE_STATE,
    TOUCHES_FIT,
    UNKNOWN,
    UNKNOWN_STATE,
)
from mbf_costmap_nav.kernels.map.rasterisation import polygon_costs

FloatArray = NDArray[np.float64]


@kernel
def first_fitting_pose(
    cells: NDArray[np.uint8], outline: FloatArray, candidates: FloatArray, yaws: FloatArray
) -> tuple[int, int, int, int]:
    """Try every heading at every candidate until the footprint fits.

    Parameters
    ----------
    cells : (height, width) uint8
    outline : (n, 2) float64
        Footprint around the base, in cells.
    candidates : (m, 2) float64
        Positions of the base in cell coordinates, on the grid, in order of preference. One whose own cell is inscribed,
        lethal or unknown is skipped.
    yaws : (k,) float64
        Headings [rad] in order of preference.

    Returns
    -------
    candidate, yaw : int
        Indices of the pose; of the first one that reaches into unknown or out of the map if none fits; -1 without any.
    state : int
        That of the pose, one of ``costs``; LETHAL_STATE if nothing was found.
    cost : int
        Highest cost under the footprint.
    """
    fallback, fallback_yaw, fallback_state = -1, -1, LETHAL_STATE
    corners = np.empty_like(outline)
    for c in range(len(candidates)):
        if cells[int(candidates[c, 1]), int(candidates[c, 0])] >= INSCRIBED:
            continue
        for k in range(len(yaws)):
            cosine, sine = np.cos(yaws[k]), np.sin(yaws[k])
            for i in range(len(outline)):
                corners[i, 0] = candidates[c, 0] + cosine * outline[i, 0] - sine * outline[i, 1]
                corners[i, 1] = candidates[c, 1] + sine * outline[i, 0] + cosine * outline[i, 1]
            covered, lethal, inscribed, unknown, _, highest = polygon_costs(cells, corners)
            if lethal > 0:
                continue
            if covered >= 0 and unknown == 0:
                return c, k, INSCRIBED_STATE if inscribed > 0 else FREE_STATE, highest
            if fallback < 0:
                fallback, fallback_yaw, fallback_state = c, k, OUTSIDE_STATE if covered < 0 else UNKNOWN_STATE
    return fallback, fallback_yaw, fallback_state, UNKNOWN if fallback_state == UNKNOWN_STATE else 0


@kernel
def fitting_poses(
    cells: NDArray[np.uint8],
    origin_x: float,
    origin_y: float,
    resolution: float,
    outline: FloatArray,
    translation: tuple[float, float, float],
    rotation: tuple[float, float, float, float],
    poses: FloatArray,
) -> NDArray[np.int8]:
    """The fit of a footprint at poses in the plane of a frame; what is lethal, unknown or off the grid is touched.

    In the arithmetic of ``Transform.apply_to_pose`` and ``Footprint.at``, so that it says the same as a check of each.

    Parameters
    ----------
    cells : (height, width) uint8
    origin_x, origin_y, resolution : float
        Of the grid [m].
    outline : (k, 2) float64
        Footprint around the base [m], which it covers.
    translation, rotation : tuple of float
        Of the frame in that of the grid [m]; x y z w.
    poses : (n, 3) float64
        x, y [m] and heading [rad] of the base in the plane of the frame.
    """
    height, width = cells.shape
    ax, ay, az, aw = rotation
    fits = np.empty(len(poses), dtype=np.int8)
    corners = np.empty_like(outline)
    for i in range(len(poses)):
        # The place: v + 2 u x (u x v + w v), as ``rotate`` has it.
        x, y = poses[i, 0], poses[i, 1]
        cx, cy, cz = aw * x - az * y, az * x + aw * y, ax * y - ay * x
        x, y = translation[0] + (x + 2.0 * (ay * cz - az * cy)), translation[1] + (y + 2.0 * (az * cx - ax * cz))
        column, row = (x - origin_x) / resolution, (y - origin_y) / resolution
        fits[i] = TOUCHES_FIT
        if not (0.0 <= column < width and 0.0 <= row < height):
            continue
        below = cells[int(row), int(column)]  # the base, which the footprint covers
        if below == LETHAL or below == UNKNOWN:
            continue
        # The heading: that of the product of both rotations.
        sine, cosine = math.sin(poses[i, 2] / 2.0), math.cos(poses[i, 2] / 2.0)
        qx, qy = ax * cosine + ay * sine, ay * cosine - ax * sine
        qz, qw = aw * sine + az * cosine, aw * cosine - az * sine
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        cosine, sine = math.cos(yaw), math.sin(yaw)
        for k in range(len(outline)):
            corners[k, 0] = (cosine * outline[k, 0] + -sine * outline[k, 1] + x - origin_x) / resolution
            corners[k, 1] = (sine * outline[k, 0] + cosine * outline[k, 1] + y - origin_y) / resolution
        covered, lethal, _, unknown, _, _ = polygon_costs(cells, corners)
        if covered >= 0 and lethal == 0 and unknown == 0:
            fits[i] = FREE_FIT
    return fits
