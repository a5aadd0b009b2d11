"""Storeys are level floors above each other; ground that only rises has none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from terrain.viewer.pictures.storeys import storeys
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.multi_level import STOREY, bridge_over_road, parking_garage
from terrain.worlds.surface import NO_SURFACE, Surface, height_grid, joined


def floor(z, size=8.0, noise=0.0, seed=0):
    lines = np.arange(0.0, size + 0.5, 0.5)
    heights = z + noise * np.random.default_rng(seed).uniform(-1.0, 1.0, (len(lines), len(lines)))
    return height_grid(lines, lines, heights)


def coarse_floor(z, diagonal, size=40.0):
    """A floor of two triangles."""
    corners = np.array([[0.0, 0.0, z], [size, 0.0, z], [size, size, z], [0.0, size, z]])
    return Surface(corners, np.array([[(0, 1, 2), (0, 2, 3)], [(0, 1, 3), (1, 2, 3)]][diagonal], np.int32))


@pytest.mark.parametrize("diagonals", [(0, 0), (0, 1), (1, 0, 1)])
def test_floors_of_two_triangles_are_found_however_they_are_split(diagonals):
    ground = joined([coarse_floor(3.0 * k, diagonal) for k, diagonal in enumerate(diagonals)])

    assert storeys(ground) == pytest.approx([3.0 * k for k in range(len(diagonals))])


def test_a_fine_floor_above_a_coarse_one_is_a_storey_and_one_beside_it_is_none():
    ground, fine = coarse_floor(0.0, 0), floor(4.0, size=30.0)

    assert storeys(joined([ground, fine])) == pytest.approx([0.0, 4.0])
    assert storeys(joined([ground, fine.at(Pose.planar(40.0, 0.0))])) == []


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
