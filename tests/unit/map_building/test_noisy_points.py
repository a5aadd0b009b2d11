"""Points with errors of some centimetres still give whole ground, its obstacles, and the error of its heights."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from surveyed_ground import flat, from_wrong_poses, ground, hills, post

from mbf_mesh_nav.building.clouds.point_cloud import PointCloud
from mbf_mesh_nav.building.heights import (
    NOT_SMOOTHED,
    HeightLimits,
    bends_of_patches,
    smoothed,
    unsupported_patches,
)
from mbf_mesh_nav.building.map_facts import map_facts
from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.kernels.building.patches import STEP_X, STEP_Y, link_patches
from mbf_mesh_nav.kernels.building.smoothing import ACROSS, smoothed_heights

NOISE, WHEELBASE = 0.06, 0.6


@pytest.fixture
def rng():
    return np.random.default_rng(12)


def ends(surface):
    """Vertices with less than a whole fan of six faces, farther than a metre from the survey's boundary."""
    inner = ((surface.vertices[:, :2] > 1.0) & (surface.vertices[:, :2] < (15.0, 11.0))).all(axis=1)
    counts = np.bincount(surface.faces.ravel(), minlength=len(surface.vertices))
    return int((inner & (counts < 4)).sum())


def test_noise_tears_no_holes_and_a_post_still_stands(rng):
    points = np.vstack([ground(rng, hills, noise=NOISE), post(rng, 8.0, 6.0, hills(8.0, 6.0), diameter=0.3)])
    surface = build_surface(points)
    places = surface.patches.centres[surface.is_obstacle]
    assert len(places)
    assert np.hypot(*(places - (8.0, 6.0)).T).max() < 0.4
    bare = build_surface(ground(rng, hills, noise=NOISE))
    assert not bare.is_obstacle.any()
    assert ends(bare) == 0


def stated_and_measured(points):
    """Stated error of the heights; root mean square of their errors, and of what two vertices 0.6 m apart differ by."""
    surface = build_surface(points)
    errors = surface.vertices[:, 2] - hills(*surface.vertices[:, :2].T)
    distances, others = cKDTree(surface.vertices[:, :2]).query(surface.vertices[:, :2] + (WHEELBASE, 0.0))
    apart = (errors[others] - errors)[distances < 0.02] / np.sqrt(2.0)  # one of two independent ones
    stated = map_facts(PointCloud(points), surface).height_error
    return stated, *(np.sqrt((of * of).mean()) for of in (errors, apart))


@pytest.mark.parametrize("noise", [0.01, 0.02, NOISE])
def test_the_stated_error_is_that_of_the_heights(rng, noise):
    stated, measured, apart = stated_and_measured(ground(rng, hills, noise=noise))
    most = 3.0 if noise == NOISE else 1.4  # smoothing is stated for rougher ground
    assert 0.95 * max(measured, apart) < stated < most * measured


def test_the_stated_error_bounds_what_wrong_poses_do_to_slopes_but_not_what_they_lift(rng):
    stated, measured, apart = stated_and_measured(from_wrong_poses(rng, ground(rng, hills)))
    assert apart < stated < 2.0 * measured
    assert apart < 0.8 * measured, "neighbours have their errors in common"


def test_noisy_points_give_a_smoother_surface_than_the_means_of_their_cells(rng):
    surface = build_surface(ground(rng, flat, noise=NOISE))
    assert surface.vertices[:, 2].std() < 0.6 * NOISE / 2.0  # four points a cell


def a_grid(seed, columns=6, rows=5):
    """Heights, links and offsets of a whole grid of cells."""
    heights = np.random.default_rng(seed).normal(0.0, 0.1, columns * rows)
    offsets = np.arange(columns * rows + 1, dtype=np.int32)
    return heights, link_patches(offsets[:-1], heights, offsets, columns, 10.0)


def naive_bends(links):
    """Rows (n, P) of the second differences along the four axes, with their weights."""
    rows = []
    for patch in range(len(links)):
        for direction in range(4):
            one, other = links[patch, direction], links[patch, direction + 4]
            if one >= 0 and other >= 0:
                row = np.zeros(len(links))
                row[[one, patch, other]] = 1.0, -2.0, 1.0
                rows.append(row * np.sqrt(1.0 if direction % 2 == 0 else ACROSS))
    return np.array(rows)


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 1000), st.floats(0.1, 3.0))
def test_heights_are_smoothed_as_by_the_normal_equations(seed, stiffness):
    heights, links = a_grid(seed)
    counts = np.random.default_rng(seed).integers(1, 7, len(heights)).astype(np.int32)
    bends = naive_bends(links)
    expected = np.linalg.solve(np.diag(counts) + stiffness * bends.T @ bends, counts * heights)
    smooth = smoothed_heights(heights, counts, links, stiffness, 2000)
    np.testing.assert_allclose(smooth, expected, rtol=0, atol=1e-6)


def test_bends_are_second_differences_with_the_variance_of_their_means():
    heights, links = a_grid(3)
    counts = np.full(len(heights), 4, dtype=np.int32)
    bends, variances = bends_of_patches(heights, counts, links)
    whole = naive_bends(links)
    along = whole[np.abs(whole).max(axis=1) == 2.0]
    np.testing.assert_allclose(np.sort(bends), np.sort(along @ heights))
    np.testing.assert_allclose(variances, 6.0 / 4.0)


def test_a_patch_at_an_edge_that_stands_out_of_the_ground_beside_it_is_no_ground():
    columns = 5
    heights = 0.1 * np.arange(columns) + np.zeros((4, 1))  # a ramp along x
    heights[2, 4] += 0.3  # at the edge
    heights[2, 2] += 0.3  # ground all around it: a boulder
    offsets = np.arange(heights.size + 1, dtype=np.int32)
    links = link_patches(offsets[:-1], heights.ravel(), offsets, columns, 10.0)
    kinds, is_ground = np.zeros(heights.size, dtype=np.int32), np.ones(heights.size, dtype=np.bool_)
    found = unsupported_patches(heights.ravel(), kinds, links, is_ground, 0.2)
    assert np.flatnonzero(found).tolist() == [2 * columns + 4]
    assert (STEP_X[4], STEP_Y[4]) == (-1, 0)  # directions as the patches count them


def test_a_post_of_which_no_ground_was_seen_becomes_no_corner_of_the_surface(rng):
    side = post(rng, 16.15, 6.0, 0.0, diameter=0.3, height=1.5)  # beyond the edge of the ground
    side = side[(side[:, 0] < 16.2) & (side[:, 2] > 0.35) & (side[:, 2] < 0.55)]  # what one ring of a lidar sees of it
    surface = build_surface(np.vstack([ground(rng, flat), side]))
    assert len(side) > 5
    assert surface.vertices[:, 2].max() < 0.1


def test_noise_widens_what_counts_as_ground_and_never_narrows_it():
    limits = HeightLimits(0.0, 0.1, 0.2, 1.5, 0.6)
    assert limits.with_noise(0.02)[1:3] == (0.1, 0.2)
    assert limits.with_noise(0.08)[1:3] == pytest.approx((0.48, 0.4))


def test_steady_heights_are_left_as_they_are(rng):
    surface = build_surface(ground(rng, hills))
    limits = HeightLimits(0.02, 0.1, 0.2, 1.5, 0.6)
    assert smoothed(surface.patches, limits) == (surface.patches, NOT_SMOOTHED)
    assert smoothed(replace(surface.patches), limits._replace(noise=0.1))[1].is_less
