"""Filling holes of a surface up to a width: morphological closing on linked patches.

The surface grows by some cells along its slopes wherever nothing is in the way, then what grew shrinks back by as many
cells from the boundary. What is left of the growth is enclosed on all sides. The boundary of the map stays where it is.
"""

from __future__ import annotations

import numpy as np

from mbf_mesh_nav.arrays import BoolArray, FloatArray, IntArray
from mbf_mesh_nav.building.surface_patches import SurfacePatches
from mbf_mesh_nav.kernels.building.patches import STEP_X, STEP_Y, slopes_of_patches

LEAST_NEIGHBOURS = 2
"""Neighbours that have to agree on the height of a patch that fills a hole."""


def without_holes(patches: SurfacePatches, widest: float, rise: float, clearance: float) -> SurfacePatches:
    """Copy in which holes of at most ``widest`` [m] are filled by patches without points.

    Parameters
    ----------
    rise : float
        Greatest difference of the heights of linked patches [m].
    clearance : float
        Free height [m] below and above a filling; where points are nearer, something stands and nothing is filled.
    """
    for reach in range(
        1, round(0.5 * widest / patches.grid.cell) + 1
    ):  # small ones first, so that a wider limit only adds
        patches = _closed(patches, reach, rise, clearance)
    return patches


def _closed(patches: SurfacePatches, reach: int, rise: float, clearance: float) -> SurfacePatches:
    """Copy that has grown by ``reach`` cells and shrunk by as many again, as far as it had grown."""
    is_old = np.ones(len(patches.cells), dtype=np.bool_)
    for _ in range(reach):
        cells, heights = _grown(patches, rise, clearance)
        patches, order = patches.with_fillings(cells, heights)
        is_old = np.append(is_old, np.zeros(len(cells), dtype=np.bool_))[order]
    for _ in range(reach):
        at_boundary = ~is_old & (patches.links(rise) < 0).any(axis=1)
        patches, is_old = patches.without(at_boundary), is_old[~at_boundary]
    return patches


def _grown(patches: SurfacePatches, rise: float, clearance: float) -> tuple[IntArray, FloatArray]:
    """Cells and heights of the patches by which the surface grows: means of what the neighbours' slopes lead to."""
    grid, links = patches.grid, patches.links(rise)
    slopes = slopes_of_patches(patches.heights, links, grid.cell)
    open_patch, direction = np.nonzero((links < 0) & ~patches.is_top[:, None])
    step_x, step_y = STEP_X[direction], STEP_Y[direction]
    column = patches.cells[open_patch] % grid.columns + step_x
    row = patches.cells[open_patch] // grid.columns + step_y
    inside = (column >= 0) & (column < grid.columns) & (row >= 0) & (row < grid.rows)
    slope_x, slope_y = slopes[open_patch].T
    heights = patches.heights[open_patch] + grid.cell * (slope_x * step_x + slope_y * step_y)
    cells, heights = (row * grid.columns + column)[inside].astype(np.int32), heights[inside]
    order = np.lexsort((heights, cells))
    cells, heights = cells[order], heights[order]
    if not len(cells):
        return cells, heights
    is_first = np.ones(len(cells), dtype=np.bool_)
    is_first[1:] = (cells[1:] != cells[:-1]) | (heights[1:] - heights[:-1] > rise)
    starts = np.flatnonzero(is_first)
    counts = np.diff(np.append(starts, len(cells)))
    means = np.add.reduceat(heights, starts) / counts
    taken = (counts >= LEAST_NEIGHBOURS) & _is_free(patches, cells[starts], means, clearance)
    return cells[starts][taken], means[taken]


def _is_free(patches: SurfacePatches, cells: IntArray, heights: FloatArray, clearance: float) -> BoolArray:
    """Whether no patch of the cells (n,) has a point within ``clearance`` of the heights (n,)."""
    offsets, is_free = patches.offsets, np.ones(len(cells), dtype=np.bool_)
    first, end = offsets[cells], offsets[cells + 1]
    for number in range(int((end - first).max(initial=0))):
        patch = np.minimum(first + number, len(patches.cells) - 1)
        is_near = (heights > patches.bottoms[patch] - clearance) & (heights < patches.tops[patch] + clearance)
        is_free &= ~(is_near & (first + number < end))
    return is_free
