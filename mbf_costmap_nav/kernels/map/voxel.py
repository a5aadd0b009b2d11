"""Columns of voxels as bits: rays and points written into a 3D grid of one 32-bit word per cell and kind.

Bit z of ``marked`` says that the voxel holds an obstacle, bit z of ``seen`` that a ray has passed or hit it. A voxel
with neither is unknown. Rays follow Bresenham's line in 3D, ends included, as costmap_2d's voxel grid.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.compiling.decorators import inner_kernel, kernel, plain_kernel
from mbf_costmap_nav.kernels.costs import FREE, LETHAL
from mbf_costmap_nav.kernels.map.raytrace import cut_to_range, grow_touched

Columns = NDArray[np.uint32]
FloatArray = NDArray[np.float64]


@kernel
def clear_voxel_rays(
    marked: Columns,
    seen: Columns,
    levels: int,
    lower_corner: FloatArray,
    voxel: FloatArray,
    sensor: FloatArray,
    ends: FloatArray,
    min_range: float,
    max_range: float,
    touched: NDArray[np.int64],
) -> None:
    """Make the voxels along rays free.

    Parameters
    ----------
    marked, seen : (height, width) uint32
    levels : int
        Number of voxels in a column, at most 32.
    lower_corner, voxel : (3,) float64
        Corner of voxel (0, 0, 0) and extents of a voxel [m].
    sensor : (3,) float64
        Common start of the rays [m].
    ends : (n, 3) float64
        Ends of the rays [m].
    min_range, max_range : float
        Part of the ray that clears [m].
    touched : (4,) int64
        Box of columns, grown.
    """
    height, width = marked.shape
    top = (width - 1, height - 1, levels - 1)
    start_point, direction = np.empty(3), np.empty(3)
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for axis in range(3):
        start_point[axis] = (sensor[axis] - lower_corner[axis]) / voxel[axis]
    for i in range(len(ends)):
        length = distance_between(ends[i], sensor)
        if length < min_range:
            continue
        start = min_range / length if length > 0.0 else 0.0
        stop = max_range / length if length > max_range else 1.0
        for axis in range(3):
            direction[axis] = (ends[i, axis] - lower_corner[axis]) / voxel[axis] - start_point[axis]
            start, stop = cut_to_range(start_point[axis], direction[axis], top[axis] + 1, start, stop)
        if start > stop:
            continue
        for axis in range(3):
            first[axis] = min(top[axis], int(start_point[axis] + start * direction[axis]))
            last[axis] = min(top[axis], int(start_point[axis] + stop * direction[axis]))
        clear_voxel_line(marked, seen, first, last)
        grow_touched(touched, first[0], first[1])
        grow_touched(touched, last[0], last[1])


@inner_kernel
def distance_between(point: FloatArray, other: FloatArray) -> float:
    """Distance [m] of two points (3,)."""
    x, y, z = point[0] - other[0], point[1] - other[1], point[2] - other[2]
    return float(np.sqrt(x * x + y * y + z * z))


@kernel
def clear_voxel_line(marked: Columns, seen: Columns, first: NDArray[np.int64], last: NDArray[np.int64]) -> None:
    """Make the voxels of a line free, both ends (ix, iy, iz) included and on the grid."""
    extents, steps, at = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    errors = np.empty(3, dtype=np.int64)
    longest = 0
    for axis in range(3):
        extents[axis], at[axis] = abs(last[axis] - first[axis]), first[axis]
        steps[axis] = 1 if last[axis] > first[axis] else -1
        longest = max(longest, extents[axis])
    for axis in range(3):
        errors[axis] = longest // 2
    for step in range(longest + 1):
        bit = np.uint32(1) << np.uint32(at[2])
        marked[at[1], at[0]] &= ~bit
        seen[at[1], at[0]] |= bit
        if step == longest:
            break
        for axis in range(3):
            # The error of the longest axis overflows in every step, those of the others now and then.
            errors[axis] += extents[axis]
            if errors[axis] >= longest:
                errors[axis] -= longest
                at[axis] += steps[axis]


@plain_kernel
def mark_voxels(
    marked: Columns,
    seen: Columns,
    levels: int,
    lower_corner: FloatArray,
    voxel: FloatArray,
    sensor: FloatArray,
    points: FloatArray,
    hits: NDArray[np.bool_],
    min_range: float,
    max_range: float,
    touched: NDArray[np.int64],
) -> None:
    """Mark the voxels of hits whose distance from the sensor lies in [min_range, max_range].

    A point below the grid marks the lowest voxel of its column. Parameters as in ``clear_voxel_rays``.
    """
    height, width = marked.shape
    for i in range(len(points)):
        distance = distance_between(points[i], sensor)
        if not hits[i] or distance < min_range or distance > max_range:
            continue
        x, y = (points[i, 0] - lower_corner[0]) / voxel[0], (points[i, 1] - lower_corner[1]) / voxel[1]
        z = max(0.0, (points[i, 2] - lower_corner[2]) / voxel[2])
        if 0.0 <= x < width and 0.0 <= y < height and z < levels:
            bit = np.uint32(1) << np.uint32(z)
            marked[int(y), int(x)] |= bit
            seen[int(y), int(x)] |= bit
            grow_touched(touched, int(x), int(y))


@plain_kernel
def count_bits(word: np.uint32) -> int:
    """Return the number of set bits (Wegner 1960: clear the lowest one until none is left)."""
    count = 0
    while word:
        word &= np.uint32(word - np.uint32(1))
        count += 1
    return count


@plain_kernel
def project_columns(
    marked: Columns,
    seen: Columns,
    levels: int,
    mark_threshold: int,
    unknown_threshold: int,
    unknown_value: int,
    cells: NDArray[np.uint8],
    box: tuple[int, int, int, int],
) -> None:
    """Write what each column of a box amounts to: LETHAL, FREE or ``unknown_value``.

    Parameters
    ----------
    mark_threshold : int
        A column is lethal with more marked voxels than this.
    unknown_threshold : int
        A column that was seen counts as unknown with more unknown voxels than this.
    unknown_value : int
        What unknown columns hold.
    box : (x0, y0, x1, y1)
        Half-open, on the grid.
    """
    for y in range(box[1], box[3]):
        for x in range(box[0], box[2]):
            known = seen[y, x]
            if count_bits(marked[y, x]) > mark_threshold:
                cells[y, x] = LETHAL
            elif known == 0 or levels - count_bits(known) > unknown_threshold:
                cells[y, x] = unknown_value
            else:
                cells[y, x] = FREE
