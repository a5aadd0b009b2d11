"""Resampling of one map on another grid: a floor plan or mask under a costmap of another resolution or frame.

Each cell takes the value of the source at its centre. A finer or rotated source has cells that no centre hits: a wall
or a painted line one cell wide would vanish. So every cost of the source is also written into the grid's cell that
contains its own centre, where it is the higher one: no obstacle is lost, and none grows by more than a cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.transform import Transform
from mbf_costmap_nav.grid.costmap import FREE, UNKNOWN, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.placement import mapped

ON_A_BORDER = 1e-6
"""A centre this close [cells] below a border counts as above it, so that rounding cannot move it back and forth: on a
grid half a cell beside its source every centre lies on one, and each wall would be lost here and twice as thick
there."""
_IDENTITY = Transform((0.0, 0.0, 0.0), parent="map", child="map")


def sample_costmap(
    source: Costmap, geometry: GridGeometry, box: CellBox, outside: int, T_source_grid: Transform | None = None
) -> CellArray:
    """Values of ``source`` in the cells of another grid.

    Parameters
    ----------
    box : CellBox
        Cells of ``geometry`` to fill.
    outside : int
        Value of cells that are not on ``source``.
    T_source_grid : Transform, optional
        From the grid's frame to the source's; none where they are the same.

    Returns
    -------
    (box rows, box columns) uint8
    """
    values = np.full((max(box.y1 - box.y0, 0), max(box.x1 - box.x0, 0)), outside, dtype=np.uint8)
    if box.empty:
        return values
    if T_source_grid is not None:
        _fill_transformed(values, source, geometry, box, T_source_grid)
        return _raised(values, source, geometry, box, T_source_grid)
    x = geometry.origin_x + (np.arange(box.x0, box.x1) + 0.5) * geometry.resolution
    y = geometry.origin_y + (np.arange(box.y0, box.y1) + 0.5) * geometry.resolution
    ix, iy = _cells(x, source.origin_x, source), _cells(y, source.origin_y, source)
    columns, rows = (ix >= 0) & (ix < source.width), (iy >= 0) & (iy < source.height)
    values[np.ix_(rows, columns)] = source.cells[np.ix_(iy[rows], ix[columns])]
    if source.resolution >= geometry.resolution:
        return values  # a centre lies in every cell of the source
    return _raised(values, source, geometry, box, _IDENTITY)


def _fill_transformed(
    values: CellArray, source: Costmap, geometry: GridGeometry, box: CellBox, T_source_grid: Transform
) -> None:
    """Give each cell of the box the value of the source at its centre."""
    rows, columns = (axis.ravel() for axis in np.indices(values.shape))
    centres = _corner(geometry, box) + (np.column_stack([columns, rows]) + 0.5) * geometry.resolution
    ix, iy = _cells(mapped(T_source_grid, centres), np.array([source.origin_x, source.origin_y]), source).T
    inside = (ix >= 0) & (ix < source.width) & (iy >= 0) & (iy < source.height)
    values[rows[inside], columns[inside]] = source.cells[iy[inside], ix[inside]]


def _raised(
    values: CellArray, source: Costmap, geometry: GridGeometry, box: CellBox, T_source_grid: Transform
) -> CellArray:
    """Raise each value to the highest cost of the source's cells whose centres lie in it."""
    lower = _corner(geometry, box)
    part = _around(source, lower, values.shape, geometry.resolution, T_source_grid)
    costs = _known(source.cells[part.slices])
    iy, ix = np.nonzero(costs)
    points = mapped(T_source_grid.inverse(), source.cells_to_world(np.column_stack([ix + part.x0, iy + part.y0])))
    x, y = _cells(points, lower, geometry).T
    seen = (x >= 0) & (x < values.shape[1]) & (y >= 0) & (y < values.shape[0])
    highest = np.zeros_like(values)
    np.maximum.at(highest, (y[seen], x[seen]), costs[iy[seen], ix[seen]])
    return _higher(values, highest)


def _corner(geometry: GridGeometry, box: CellBox) -> NDArray[np.float64]:
    """Lower left corner (2,) [m] of a box of cells."""
    return np.array([geometry.origin_x, geometry.origin_y]) + np.array([box.x0, box.y0]) * geometry.resolution


def _cells(
    points: NDArray[np.floating[Any]], lower: float | NDArray[np.float64], grid: GridGeometry
) -> NDArray[np.int64]:
    """Index of the cell of ``grid``, counted from its corner ``lower`` [m], in which each point [m] lies."""
    return np.asarray(np.floor((points - lower) / grid.resolution + ON_A_BORDER), dtype=np.int64)


def _around(
    source: Costmap, lower: NDArray[np.float64], shape: tuple[int, ...], resolution: float, T_source_grid: Transform
) -> CellBox:
    """Cells of the source in which a part of the grid, (rows, columns) from ``lower`` [m] on, may lie."""
    extent = np.array([[0, 0], [shape[1], 0], [0, shape[0]], [shape[1], shape[0]]]) * resolution
    corners = (mapped(T_source_grid, lower + extent) - (source.origin_x, source.origin_y)) / source.resolution
    (x0, y0), (x1, y1) = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
    around = CellBox(int(x0), int(y0), int(x1), int(y1)).grown(1).clipped(source.geometry.box)
    return CellBox(0, 0, 0, 0) if around.empty else around


def _known(cells: CellArray) -> CellArray:
    """Costs with unknown as free: it raises nothing."""
    return np.where(cells == UNKNOWN, np.uint8(FREE), cells)


def _higher(values: CellArray, costs: CellArray) -> CellArray:
    """The higher of both where there is a cost; any cost replaces unknown, free does not."""
    raises = (costs > FREE) & ((values == UNKNOWN) | (costs > values))
    return np.where(raises, costs, values)
