"""Which patches show the underside of a slab only, and which lie over ground that was not seen."""

import numpy as np
import pytest

from mbf_mesh_nav.building.slabs import over_unseen_ground, without_undersides
from mbf_mesh_nav.building.surface_patches import Grid, SurfacePatches
from mbf_mesh_nav.kernels.building.columns import LOWEST, SLAB

SIDE, CELL, RISE = 8, 0.2, 0.6


def patches(heights, kind, missing=()):
    """A patch in each cell of a square, but for the missing ones."""
    cells = np.setdiff1d(np.arange(SIDE * SIDE), missing).astype(np.int32)
    z, numbers = np.asarray(heights, dtype=float).reshape(-1)[cells], np.arange(len(cells))
    grid = Grid(np.zeros(2), CELL, SIDE, SIDE)
    kinds, standing = np.full(len(cells), kind, dtype=np.int32), np.zeros(len(cells), dtype=np.int32)
    return SurfacePatches(grid, cells, kinds, numbers, numbers + 1, z, z, z, standing)


def level(height=3.0):
    return np.full((SIDE, SIDE), height)


@pytest.mark.parametrize("hidden", [[(3, 3)], [(3, 3), (3, 4), (4, 3), (4, 4)], [(0, 0)], [(0, 5), (0, 6), (7, 2)]])
def test_an_underside_among_tops_is_left_out(hidden):
    heights, expected = level(), np.ones((SIDE, SIDE), dtype=bool)
    for place in hidden:
        heights[place], expected[place] = 2.6, False
    kept = without_undersides(patches(heights, SLAB), 0.1, RISE)
    np.testing.assert_array_equal(kept.cells, np.flatnonzero(expected))


@pytest.mark.parametrize("kind", [LOWEST, SLAB])
def test_kerbs_ramps_and_the_ground_itself_lose_nothing(kind):
    kerb, ramp = level(), np.tile(3.0 + 0.12 * np.arange(SIDE), (SIDE, 1))
    kerb[:, 4:] += 0.15
    for heights in (kerb, ramp, level()):
        assert len(without_undersides(patches(heights, kind), 0.1, RISE).cells) == SIDE * SIDE
    pit = level()
    pit[3, 3] = 2.6
    assert len(without_undersides(patches(pit, kind), 0.1, RISE).cells) == SIDE * SIDE - (kind == SLAB)


@pytest.mark.parametrize("places", [[(3, 3)], [(3, 3), (3, 4), (4, 3), (4, 4)], [(0, 0), (0, 1)]])
def test_a_slab_where_no_ground_below_was_seen_is_no_ground(places):
    heights, expected = level(0.0), np.full((SIDE, SIDE), LOWEST)
    for place in places:
        heights[place], expected[place] = 2.8, SLAB
    raised = over_unseen_ground(patches(heights, LOWEST), 1.5, 1.0)
    np.testing.assert_array_equal(raised.kinds, expected.reshape(-1))
    low = over_unseen_ground(patches(0.5 * heights, LOWEST), 1.5, 1.0)
    assert (low.kinds == LOWEST).all()  # a robot does not fit below: it stands on the ground


def test_the_edge_of_a_plateau_stays_ground_however_much_lower_its_foot_is():
    heights = level(0.0)
    heights[:, 4:] = 6.0
    assert (over_unseen_ground(patches(heights, LOWEST, missing=[12, 40]), 1.5, 1.0).kinds == LOWEST).all()
