"""Check that a polygon is a valid outline of a robot, once, where a configuration is read.

When to use: for outlines from users. When not: outlines made by ``Footprint`` itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.polygon import cross_products, crossing_sides

FloatArray = NDArray[np.float64]

LEAST_AREA = 1e-6
"""[m2]; a square of a millimetre."""


def outline_problem(corners: FloatArray) -> str:
    """Why corners (n, 2) [m] are not the outline of a robot around its base; "" if they are.

    A corner that is given twice in a row, also the first one again at the end, counts once.
    """
    points = corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]
    ends = np.roll(points, -1, axis=0)
    area = 0.5 * float(abs(np.add.accumulate(cross_products(points, ends))[-1])) if len(points) else 0.0
    crossing = crossing_sides(points)
    if crossing is not None:
        return f"an outline whose sides do not cross, but side {crossing[0]} meets side {crossing[1]}"
    if not area >= LEAST_AREA:
        return f"an outline with an area of at least {LEAST_AREA:g} m², not {area:g} m²"
    if not _holds_origin(points, ends):
        return "an outline around the base, (0, 0), which lies outside of it"
    return ""


def _holds_origin(points: FloatArray, ends: FloatArray) -> bool:
    """Whether the origin lies in a simple polygon or on its sides."""
    turns = cross_products(points, ends)
    on_side = (turns == 0.0) & (points[:, 0] * ends[:, 0] + points[:, 1] * ends[:, 1] <= 0.0)
    spans = (points[:, 1] > 0.0) != (ends[:, 1] > 0.0)
    to_the_right = spans & ((turns > 0.0) == (ends[:, 1] > points[:, 1]))
    return bool(on_side.any() or np.count_nonzero(to_the_right) % 2 == 1)
