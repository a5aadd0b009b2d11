"""Occupancies of an image rotated against its frame, resampled on the smallest axis-aligned grid around them.

Each new cell takes the value at its centre; what lies outside the rotated image is unknown. Occupied cells that no new
centre hits are also written where their own centre lies, so that no obstacle is lost. The work is done in blocks of
rows, so it needs little memory beside the maps themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import plane_rotation, rotated, rotated_back
from mbf_costmap_nav.files.map_description import OCCUPIED, UNKNOWN_OCCUPANCY, OccupancyArray

BLOCK_CELLS = 500_000
"""Cells per block; each takes about 100 bytes of temporary memory."""


def axis_aligned_shape(
    shape: tuple[int, ...], yaw: float, max_cells: int
) -> tuple[tuple[int, int], NDArray[np.float64]]:
    """Size and lower-left corner of the smallest axis-aligned grid around a rotated image.

    Parameters
    ----------
    shape : (height, width)
        Of the image [cells].
    yaw : float
        Rotation [rad] about the corner of cell (0, 0).

    Returns
    -------
    (height, width) : int
    lower : (2,) float64
        Lower-left corner (x, y) of the grid [cells], relative to the corner of cell (0, 0).

    Raises
    ------
    ValueError
        The grid has more than ``max_cells`` cells.
    """
    height, width = shape
    if math.remainder(yaw, 2.0 * math.pi) == 0.0:
        return (height, width), np.zeros(2)
    corners = rotated(plane_rotation(yaw), [[0, 0], [width, 0], [width, height], [0, height]])
    lower = corners.min(axis=0)
    columns, rows = np.ceil(corners.max(axis=0) - lower - 1e-9).astype(int).tolist()
    if rows * columns > max_cells:
        raise ValueError(
            f"rotated by {yaw:g} rad it needs {columns} x {rows} cells, more than the limit of {max_cells}"
        )
    return (rows, columns), lower


def rotated_to_axes(
    occupancy: OccupancyArray, yaw: float, max_cells: int
) -> tuple[OccupancyArray, tuple[float, float]]:
    """Return the occupancies on an axis-aligned grid, and its lower-left corner [cells] relative to the old one.

    Parameters
    ----------
    occupancy : (height, width) uint8
        Bottom row first.
    yaw : float
        Rotation [rad] about the corner of cell (0, 0).

    Raises
    ------
    ValueError
        The new grid has more than ``max_cells`` cells.
    """
    shape, lower = axis_aligned_shape(occupancy.shape, yaw, max_cells)
    (height, width), rotation = occupancy.shape, plane_rotation(yaw)
    aligned = np.full(shape, UNKNOWN_OCCUPANCY, dtype=np.uint8)
    for block in _row_blocks(shape):  # 1. Each new cell takes the value at its centre.
        columns, rows = np.meshgrid(np.arange(shape[1]), np.arange(block.start, block.stop))
        source = np.floor(rotated_back(rotation, np.stack([columns, rows], axis=-1) + 0.5 + lower)).astype(np.int64)
        inside = np.all((source >= 0) & (source < (width, height)), axis=-1)
        aligned[block][inside] = occupancy[source[inside][:, 1], source[inside][:, 0]]
    for block in _row_blocks(occupancy.shape):  # 2. Occupied cells are also written where their own centres lie.
        part = occupancy[block]
        iy, ix = np.nonzero((part >= OCCUPIED) & (part != UNKNOWN_OCCUPANCY))
        points = rotated(rotation, np.column_stack([ix, iy + block.start]) + 0.5) - lower
        cells = np.minimum(points.astype(np.int64), (shape[1] - 1, shape[0] - 1))
        aligned[cells[:, 1], cells[:, 0]] = part[iy, ix]
    return aligned, (float(lower[0]), float(lower[1]))


def _row_blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    rows = max(1, BLOCK_CELLS // shape[1])
    return (slice(start, min(start + rows, shape[0])) for start in range(0, shape[0], rows))
