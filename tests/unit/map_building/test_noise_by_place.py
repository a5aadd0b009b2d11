"""Where grass stands the points are noisier, which is no disagreement about the ground."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from surveyed_ground import flat, ground

from mbf_mesh_nav.building.noise_by_place import BINS_IN_MEDIAN, BLOCK, medians_by_place
from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.building.surface_patches import Grid, SurfacePatches
from mbf_mesh_nav.kernels.building.disagreement import BINS, distance_histograms

GRASS = 0.1


def with_grass(rng, points):
    """Every other point beyond x = 8 m on a blade of grass of up to 0.1 m."""
    blade = (points[:, 0] > 8.0) & (rng.random(len(points)) < 0.5)
    return points + np.outer(np.where(blade, rng.uniform(0.0, GRASS, len(points)), 0.0), [0.0, 0.0, 1.0])


def test_grass_states_what_its_heights_differ_by_and_not_the_height_of_its_blades():
    rng = np.random.default_rng(41)
    surface = build_surface(with_grass(rng, ground(rng, flat)))
    x = surface.vertices[:, 0]
    inner = ((surface.vertices[:, :2] > 1.0) & (surface.vertices[:, :2] < (15.0, 11.0))).all(axis=1)
    for where in (inner & (x < 6.0), inner & (x > 10.0)):
        stated, differ = np.median(surface.height_errors[where]), surface.vertices[where, 2].std()
        assert 0.9 * differ < stated < 1.35 * differ


def test_a_boulder_does_not_change_the_noise_around_it():
    rng = np.random.default_rng(42)
    distances = rng.normal(0.0, 0.02, 40 * 40 * 4).astype(np.float32)
    patches = patches_of(40, 40, 4)
    usual = medians_by_place(patches, distances, np.ones(1600, dtype=np.bool_))
    boulder = np.abs(patches.cells % 40 - 20) + np.abs(patches.cells // 40 - 20) < 5
    distances[np.repeat(boulder, 4)] += np.float32(0.2)
    with_boulder = medians_by_place(patches, distances, np.ones(1600, dtype=np.bool_))
    assert boulder.sum() > 40
    assert (with_boulder < 1.3 * usual).all()


def patches_of(columns, rows, points):
    """One patch a cell with as many points each."""
    cells = np.arange(columns * rows, dtype=np.int32)
    firsts, zeros = points * cells.astype(np.int64), np.zeros(len(cells))
    grid, none = Grid(np.zeros(2), 0.2, columns, rows), np.zeros(len(cells), dtype=np.int32)
    return SurfacePatches(grid, cells, none, firsts, firsts + points, zeros, zeros, zeros, none)


@settings(deadline=None, max_examples=20)
@example(1281)
@given(st.integers(0, 10_000))
def test_the_median_of_a_place_is_that_of_its_block_and_the_eight_around_it(seed):
    rng = np.random.default_rng(seed)
    columns, rows, points = int(rng.integers(6, 24)), int(rng.integers(6, 24)), 5
    patches, used = patches_of(columns, rows, points), rng.random(columns * rows) < 0.9
    distances = rng.normal(0.0, rng.uniform(0.01, 0.04), columns * rows * points).astype(np.float32)
    distances[rng.random(len(distances)) < 0.1] = np.nan
    found = medians_by_place(patches, distances, used)
    across, up = patches.cells % columns // BLOCK, patches.cells // columns // BLOCK
    width = np.nanmedian(np.abs(distances)) / BINS_IN_MEDIAN
    for patch in range(len(patches.cells)):
        around = used & (np.abs(across - across[patch]) <= 1) & (np.abs(up - up[patch]) <= 1)
        own = np.abs(distances[np.repeat(around, points)])
        own = own[np.isfinite(own)]
        if len(own) < 100:
            assert found[patch] == np.nanmedian(np.abs(distances))
        else:  # of an even number of points the lower of the two in the middle is in the bin whose middle is given
            assert abs(found[patch] - np.quantile(own, 0.5, method="lower")) <= 0.5 * width * (1.0 + 1e-5)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000))
def test_histograms_count_the_points_of_used_patches_once(seed):
    rng = np.random.default_rng(seed)
    patches, used = patches_of(6, 5, 3), rng.random(30) < 0.7
    distances = np.where(rng.random(90) < 0.2, np.nan, rng.normal(0.0, 1.0, 90)).astype(np.float32)
    blocks = rng.integers(0, 4, 30).astype(np.int32)
    expected = np.zeros((4, BINS), dtype=np.int32)
    for number, distance in enumerate(np.abs(distances.astype(np.float64))):
        if used[number // 3] and np.isfinite(distance):
            expected[blocks[number // 3], min(int(distance / 0.01), BINS - 1)] += 1
    arrays = distances, patches.firsts, patches.ends, used, blocks
    np.testing.assert_array_equal(distance_histograms(*arrays, 4, 0.01), expected)
