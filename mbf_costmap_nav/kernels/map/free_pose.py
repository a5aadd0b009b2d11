"""The search of the nearest pose at which a footprint fits: candidates in order, headings in order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import kernel
from mbf_costmap_nav.kernels.costs import (
    FREE_STATE,
    INSCRIBED,
    INSCRIBED_STATE,
    LETHAL_STATE,
    OUTSIDE_STATE,
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
