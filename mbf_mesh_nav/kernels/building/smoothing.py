"""Heights of surface patches weighed between their points and a smooth surface; patches that no ground holds up."""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.kernels.building.columns import LOWEST
from mbf_mesh_nav.kernels.building.patches import DIRECTIONS
from mbf_mesh_nav.kernels.compiled import kernel

ACROSS = 0.25
"""Weight of a bend along a diagonal: over a step of sqrt(2) cells, the same curvature bends it twice as much."""


@kernel
def smoothed_heights(
    heights: FloatArray, counts: IntArray, links: IntArray, stiffness: float, rounds: int
) -> FloatArray:
    """Heights (P,) that minimise the sum of ``counts`` (new - old)^2 and ``stiffness`` times that of all bends squared.

    A bend is the second difference of three patches in a row, along one of the four axes. Gauss-Seidel, ``rounds``
    times over all patches.

    Parameters
    ----------
    counts : (P,) int32
        Points of a patch; a height without any is the smooth surface's alone.
    links : (P, 8) int32
        As in ``kernels.building.patches``.
    stiffness : float
        In points: the variance of a point's error over that of a bend of the ground.
    """
    smooth = heights.copy()
    for _ in range(rounds):
        for patch in range(heights.shape[0]):
            total, weight = counts[patch] * heights[patch], 1.0 * counts[patch]
            for direction in range(DIRECTIONS):
                part = stiffness if direction % 2 == 0 else stiffness * ACROSS
                other, back = links[patch, direction], links[patch, (direction + 4) % DIRECTIONS]
                if other < 0:
                    continue
                if direction < 4 and back >= 0:
                    total += 2.0 * part * (smooth[other] + smooth[back])
                    weight += 4.0 * part
                beyond = links[other, direction]
                if beyond >= 0:
                    total += part * (2.0 * smooth[other] - smooth[beyond])
                    weight += part
            if weight > 0.0:
                smooth[patch] = total / weight
    return smooth


@kernel
def bends_of_patches(heights: FloatArray, counts: IntArray, links: IntArray) -> tuple[FloatArray, FloatArray]:
    """Second differences (n,) [m] of the heights along rows and columns, and what one point's error adds to each (n,).

    The second is the variance of a difference for heights that are means of ``counts`` (P,) points with a variance of
    one.
    """
    most = 2 * heights.shape[0]
    bends, variances = np.empty(most, dtype=np.float64), np.empty(most, dtype=np.float64)
    found = 0
    for patch in range(heights.shape[0]):
        for direction in range(0, 4, 2):
            one, other = links[patch, direction], links[patch, direction + 4]
            if one < 0 or other < 0 or counts[patch] == 0 or counts[one] == 0 or counts[other] == 0:
                continue
            bends[found] = heights[one] - 2.0 * heights[patch] + heights[other]
            variances[found] = 1.0 / counts[one] + 4.0 / counts[patch] + 1.0 / counts[other]
            found += 1
    return bends[:found].copy(), variances[:found].copy()


@kernel
def unsupported_patches(
    heights: FloatArray, kinds: IntArray, links: IntArray, is_ground: BoolArray, step: float
) -> BoolArray:
    """Mask (P,) of lowest patches at an edge that are more than ``step`` [m] above where the ground beside them leads.

    At the edge of what was seen a column may hold points of a post and none of the ground below it. Such a patch has
    ground on one side, from which it stands out, and none in the three cells on the other.

    Parameters
    ----------
    is_ground : (P,) bool
        Patches that are still taken for ground; links to others do not count.
    """
    mask = np.zeros(heights.shape[0], dtype=np.bool_)
    for patch in range(heights.shape[0]):
        if kinds[patch] != LOWEST or not is_ground[patch]:
            continue
        for direction in range(DIRECTIONS):
            other = links[patch, direction]
            if other < 0 or not is_ground[other]:
                continue
            is_edge = True
            for aside in range(3, 6):
                beyond = links[patch, (direction + aside) % DIRECTIONS]
                is_edge = is_edge and (beyond < 0 or not is_ground[beyond])
            if not is_edge:
                continue
            behind = links[other, direction]
            rise = heights[other] - heights[behind] if behind >= 0 and is_ground[behind] else 0.0
            if heights[patch] - heights[other] - max(rise, 0.0) > step:
                mask[patch] = True
    return mask
