"""Slabs that were seen from below and from above: ceilings of one storey and ground of the next one.

In some cells there are points of the underside only: a hole in the surface above, and no step down to the underside. In
others there are none of the ground below, and a slab is the lowest that was seen. Taken as they are, both make a storey
so rugged that it passes for the crown of a tree.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbf_mesh_nav.building.surface_patches import SurfacePatches
from mbf_mesh_nav.kernels.building.columns import SLAB
from mbf_mesh_nav.kernels.building.patches import DIRECTIONS, STEP_X, STEP_Y

LEAST_NEIGHBOURS, MOST = 3, 0.6
"""What most of so many neighbours show is believed: 5 of 8 are higher around each of four undersides in a square. Along
a step as many are only in its inner corner."""


def over_unseen_ground(patches: SurfacePatches, gap: float, thickest: float) -> SurfacePatches:
    """Copy in which lowest patches far above the ground of most cells around them are slabs: no point below was seen.

    Parameters
    ----------
    gap : float
        How far above, at least [m].
    thickest : float
        Thickness of a slab at most [m].
    """
    grid = patches.grid
    bottoms = np.full((grid.rows + 2, grid.columns + 2), np.nan)
    rows, columns = patches.cells // grid.columns + 1, patches.cells % grid.columns + 1
    bottoms[rows[patches.is_ground], columns[patches.is_ground]] = patches.bottoms[patches.is_ground]
    is_raised = np.zeros(len(patches.cells), dtype=np.bool_)
    thin = np.flatnonzero(patches.is_ground & (patches.tops - patches.bottoms <= thickest))
    while True:
        around = np.stack([bottoms[rows[thin] + dy, columns[thin] + dx] for dx, dy in zip(STEP_X, STEP_Y, strict=True)])
        neighbours = np.count_nonzero(~np.isnan(around), axis=0)
        lower = np.count_nonzero(around < patches.bottoms[thin] - gap, axis=0)
        found = ~is_raised[thin] & (neighbours >= LEAST_NEIGHBOURS) & (lower >= MOST * neighbours)
        if not found.any():
            return replace(patches, kinds=np.where(is_raised, SLAB, patches.kinds).astype(np.int32))
        is_raised[thin[found]] = True
        bottoms[rows[thin[found]], columns[thin[found]]] = np.nan


def without_undersides(patches: SurfacePatches, thickness: float, rise: float) -> SurfacePatches:
    """Copy without thin patches above ground that lie below where most neighbours lead.

    A neighbour leads on as it comes from the patch behind it, so a ramp leads down to its foot.

    Parameters
    ----------
    thickness, rise : float
        How much below, at least and at most [m]; a slab that is thicker than ``rise`` shows no step, but a gap.
    """
    links, heights = patches.links(rise), patches.heights
    is_kept = np.ones(len(patches.cells), dtype=np.bool_)
    is_linked = links >= 0
    behind = np.stack([links[links[:, direction], direction] for direction in range(DIRECTIONS)], axis=1)
    descent = np.where(behind >= 0, np.maximum(heights[behind] - heights[links], 0.0), 0.0)
    is_higher = is_linked & (heights[links] - descent - heights[:, None] > thickness)
    is_thin = patches.kinds == SLAB
    while True:
        neighbours = (is_linked & is_kept[links]).sum(axis=1)
        higher = (is_higher & is_kept[links]).sum(axis=1)
        found = is_kept & is_thin & (neighbours >= LEAST_NEIGHBOURS) & (higher >= MOST * neighbours)
        if not found.any():
            return patches.without(~is_kept)
        is_kept &= ~found
