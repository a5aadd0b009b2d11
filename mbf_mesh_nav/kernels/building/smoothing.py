"""Heights of surface patches weighed between their points and a smooth surface."""

from __future__ import annotations

from mbf_mesh_nav.arrays import FloatArray, IntArray
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
