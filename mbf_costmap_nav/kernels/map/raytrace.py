"""Rays and points written into a grid: the inner loops of the obstacle layers.

A ray visits cells by Bresenham's line, from the cell of the sensor to the cell of its end, both included, as
costmap_2d's raytraceLine. Unlike there, a ray that starts or ends out of the grid is cut at the border and still clears
the part that lies on it.

``touched`` is an int64 box (x0, y0, x1, y1), half-open, that the kernels grow by the cells they write.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, plain_kernel

FloatArray = NDArray[np.float64]
TouchedBox = NDArray[np.int64]


@plain_kernel
def clear_rays(
    cells: NDArray[np.uint8],
    lower_left: FloatArray,
    resolution: float,
    sensor: FloatArray,
    ends: FloatArray,
    min_range: float,
    max_range: float,
    value: int,
    touched: TouchedBox,
) -> None:
    """Write ``value`` along rays.

    Parameters
    ----------
    cells : (height, width) uint8
    lower_left : (2,) float64
        Origin of the grid [m].
    resolution : float
        Side of a cell [m].
    sensor : (3,) float64
        Common start of the rays [m].
    ends : (n, 3) float64
        Ends of the rays [m]; z is ignored.
    min_range, max_range : float
        Part of the ray that clears [m].
    value : int
        Usually 0, free.
    touched : (4,) int64
    """
    height, width = cells.shape
    x0, y0 = (sensor[0] - lower_left[0]) / resolution, (sensor[1] - lower_left[1]) / resolution
    for i in range(len(ends)):
        dx, dy = (ends[i, 0] - lower_left[0]) / resolution - x0, (ends[i, 1] - lower_left[1]) / resolution - y0
        length = math.hypot(dx, dy) * resolution
        if length < min_range:
            continue
        start = min_range / length if length > 0.0 else 0.0
        stop = max_range / length if length > max_range else 1.0
        start, stop = cut_to_range(x0, dx, width, start, stop)
        start, stop = cut_to_range(y0, dy, height, start, stop)
        if start > stop:
            continue
        _write_line(
            cells,
            min(width - 1, int(x0 + start * dx)),
            min(height - 1, int(y0 + start * dy)),
            min(width - 1, int(x0 + stop * dx)),
            min(height - 1, int(y0 + stop * dy)),
            value,
            touched,
        )


@inner_kernel
def cut_to_range(start_value: float, slope: float, size: int, start: float, stop: float) -> tuple[float, float]:
    """Part [start, stop] of a line start_value + t * slope that lies in [0, size] (Liang and Barsky 1984)."""
    if slope == 0.0:
        return (start, stop) if 0.0 <= start_value < size else (1.0, 0.0)
    first, second = -start_value / slope, (size - start_value) / slope
    if first > second:
        first, second = second, first
    return max(start, first), min(stop, second)


@inner_kernel
def grow_touched(touched: TouchedBox, x: int, y: int) -> None:
    """Grow the box by one cell."""
    if touched[2] <= touched[0]:
        touched[0], touched[1], touched[2], touched[3] = x, y, x + 1, y + 1
        return
    touched[0], touched[1] = min(touched[0], x), min(touched[1], y)
    touched[2], touched[3] = max(touched[2], x + 1), max(touched[3], y + 1)


@plain_kernel
def _write_line(cells: NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int, value: int, touched: TouchedBox) -> None:
    """Bresenham's line; rounding as costmap_2d (the error starts at half the longer extent)."""
    grow_touched(touched, x0, y0)
    grow_touched(touched, x1, y1)
    flat = cells.reshape(-1)
    width = cells.shape[1]
    extent_x, extent_y = abs(x1 - x0), abs(y1 - y0)
    step_x = 1 if x1 > x0 else -1
    step_y = width if y1 > y0 else -width
    if extent_x >= extent_y:
        longer, shorter, step_longer, step_shorter = extent_x, extent_y, step_x, step_y
    else:
        longer, shorter, step_longer, step_shorter = extent_y, extent_x, step_y, step_x
    offset, error = y0 * width + x0, longer // 2
    flat[offset] = value
    for _ in range(longer):
        offset += step_longer
        error += shorter
        if error >= longer:
            offset += step_shorter
            error -= longer
        flat[offset] = value


@plain_kernel
def mark_points(
    cells: NDArray[np.uint8],
    lower_left: FloatArray,
    resolution: float,
    sensor: FloatArray,
    points: FloatArray,
    hits: NDArray[np.bool_],
    min_range: float,
    max_range: float,
    value: int,
    touched: TouchedBox,
) -> None:
    """Write ``value`` at the cells of hits whose 3D distance from the sensor lies in [min_range, max_range].

    Parameters as in ``clear_rays``; ``hits`` is (n,) bool, other points are skipped.
    """
    height, width = cells.shape
    for i in range(len(points)):
        if not hits[i]:
            continue
        dx, dy, dz = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        distance_squared = dx * dx + dy * dy + dz * dz
        if distance_squared > max_range * max_range or distance_squared < min_range * min_range:
            continue
        x, y = (points[i, 0] - lower_left[0]) / resolution, (points[i, 1] - lower_left[1]) / resolution
        if 0.0 <= x < width and 0.0 <= y < height:
            cells[int(y), int(x)] = value
            grow_touched(touched, int(x), int(y))
