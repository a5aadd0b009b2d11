"""Storeys are level floors above each other; ground that only rises has none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from terrain.viewer.pictures.storeys import storey_of, storeys
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.multi_level import STOREY, bridge_over_road, parking_garage
from terrain.worlds.surface import NO_SURFACE, height_grid, joined


def floor(z, size=8.0, noise=0.0, seed=0):
    lines = np.arange(0.0, size + 0.5, 0.5)
    heights = z + noise * np.random.default_rng(seed).uniform(-1.0, 1.0, (len(lines), len(lines)))
    return height_grid(lines, lines, heights)


@pytest.mark.parametrize("levels", [2, 3, 4])
def test_a_garage_has_its_floors(levels):
    np.testing.assert_allclose(storeys(parking_garage(levels).ground), STOREY * np.arange(levels), atol=0.05)


def test_a_bridge_is_above_its_road():
    assert len(storeys(bridge_over_road().ground)) == 2


@pytest.mark.parametrize(
    "ground",
    [
        None,
        NO_SURFACE,
        floor(1.0),
        fractal_terrain(40.0, 40.0, 0.5, np.random.default_rng(3), roughness=0.05).surface(),
        joined([floor(0.0), floor(5.0).at(Pose.planar(20.0, 0.0))]),
        joined([floor(0.0), floor(1.2)]),
    ],
    ids=["nothing", "empty", "floor", "hills", "terrace beside a floor", "table"],
)
def test_one_level_is_no_storey(ground):
    assert storeys(ground) == []


@settings(max_examples=25)
@given(st.lists(st.floats(2.0, 6.0), min_size=1, max_size=4), st.floats(-50.0, 50.0), st.integers(0, 99))
def test_floors_are_found_at_their_heights_however_far_apart_they_are(gaps, lowest, seed):
    heights = np.cumsum([lowest, *gaps])
    ground = joined([floor(z, noise=0.01, seed=seed + k) for k, z in enumerate(heights)])

    np.testing.assert_allclose(storeys(ground), heights, atol=0.05)
    np.testing.assert_array_equal(storey_of(heights.tolist(), heights + 0.4), np.arange(len(heights)))
