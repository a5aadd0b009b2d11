"""Points inside polygons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_mesh_nav.kernels.compiled import kernel


@kernel
def inside_polygon(points: NDArray[np.float64], polygon: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (n,) of points (n, 3) whose x, y lie in a closed polygon (m, 2), even-odd rule."""
    inside = np.zeros(points.shape[0], dtype=np.bool_)
    corners = polygon.shape[0]
    for index in range(points.shape[0]):
        x, y = points[index, 0], points[index, 1]
        crossings = 0
        for corner in range(corners):
            x1, y1 = polygon[corner, 0], polygon[corner, 1]
            x2, y2 = polygon[(corner + 1) % corners, 0], polygon[(corner + 1) % corners, 1]
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
                crossings += 1
        inside[index] = crossings % 2 == 1
    return inside
