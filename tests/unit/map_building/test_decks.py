"""A ramp is whole down to its foot, a bridge over unseen ground lies on its top; tables and grass stay as they are."""

from itertools import pairwise

import numpy as np
import pytest
from surveyed_ground import rectangle

from mbf_mesh_nav.building.surface import build_surface
from mbf_mesh_nav.kernels.building.decks import SHARE, top_layers


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def naive_layer(heights, band, thickest, tallest):
    """Place of the first point of the upper side, mean heights of lower and upper points, and whether it is a deck."""
    lower = [z for z in heights if z <= heights[0] + band]
    upper = [z for z in heights if z >= heights[-1] - band]
    gaps = [top for low, top in pairwise(heights) if top - low >= band]
    is_deck = any(top >= heights[-1] - thickest for top in gaps) and heights[-1] - heights[0] <= tallest
    is_deck = is_deck and len(upper) >= SHARE * len(heights)
    return len(heights) - len(upper), np.mean(lower), np.mean(upper), is_deck


@pytest.mark.parametrize("seed", range(8))
def test_upper_layers_are_those_of_a_naive_look(seed):
    rng = np.random.default_rng(seed)
    runs = [np.sort(rng.choice([0.0, 0.3, 0.5, 1.3], 6) + rng.uniform(0.0, 0.2, 6)) for _ in range(40)]
    ends = np.cumsum([len(run) for run in runs])
    points = np.column_stack([np.zeros((ends[-1], 2)), np.concatenate(runs)])
    found = top_layers(points, ends - 6, ends, 0.1, 0.5, 1.15)
    for number, run in enumerate(runs):
        first, low, high, is_deck = naive_layer(run, 0.1, 0.5, 1.15)
        assert found.firsts[number] == ends[number] - 6 + first and found.is_deck[number] == is_deck
        assert (found.bottoms[number], found.tops[number]) == pytest.approx((low, high))


def ramp(rng, thickness):
    """A floor, and a ramp of 2 m up to a platform at 2 m, both slabs that were seen from both sides."""
    floor = rectangle(rng, (0.0, 14.0), (0.0, 8.0), (0.0, 0.0))
    foot = 3.0 + 3.0 * thickness
    return np.vstack(
        [
            floor,
            rectangle(rng, (3.0, 9.0), (3.0, 5.0), (0.0, 2.0)),
            rectangle(rng, (foot, 9.0), (3.0, 5.0), (0.0, 2.0 - thickness)),
            *(rectangle(rng, (9.0, 13.0), (3.0, 5.0), (z, z)) for z in (2.0, 2.0 - thickness)),
        ]
    )


@pytest.mark.parametrize("thickness", [0.15, 0.3])
def test_a_ramp_that_was_seen_from_below_is_whole_down_to_its_foot(rng, thickness):
    vertices = build_surface(ramp(rng, thickness)).vertices
    for x in np.arange(3.2, 9.0, 0.2):
        beside = vertices[(np.abs(vertices[:, 0] - x) < 0.15) & (np.abs(vertices[:, 1] - 4.0) < 0.5)]
        assert (np.abs(beside[:, 2] - (beside[:, 0] - 3.0) / 3.0) < 0.1).any(), f"no ramp at {x:.1f} m"


def test_a_bridge_over_ground_that_nobody_saw_lies_on_its_top(rng):
    banks = [rectangle(rng, x, (0.0, 8.0), (0.0, 0.0)) for x in ((0.0, 5.0), (9.0, 14.0))]
    deck = [rectangle(rng, (5.0, 9.0), (3.0, 5.0), (z, z)) for z in (0.0, -0.4)]
    vertices = build_surface(np.vstack([*banks, *deck])).vertices
    amid = vertices[(np.abs(vertices[:, 0] - 7.0) < 1.7) & (np.abs(vertices[:, 1] - 4.0) < 0.7)]
    assert len(amid) > 80
    np.testing.assert_allclose(amid[:, 2], 0.0, atol=0.12)


@pytest.mark.parametrize("height", [0.3, 0.45, 0.7, 1.1])
def test_a_table_stays_an_obstacle_however_low(rng, height):
    floor = rectangle(rng, (0.0, 14.0), (0.0, 8.0), (0.0, 0.0))
    table = [rectangle(rng, (5.0, 7.0), (3.0, 5.0), (z, z)) for z in (height, height - 0.04)]
    vertices = build_surface(np.vstack([floor, *table])).vertices
    assert not ((np.abs(vertices[:, 0] - 6.0) < 0.7) & (np.abs(vertices[:, 1] - 4.0) < 0.7)).any()


@pytest.mark.parametrize("blades", [100, 400])
def test_tips_of_grass_are_no_deck(rng, blades):
    floor = rectangle(rng, (0.0, 14.0), (0.0, 8.0), (0.0, 0.0))
    grass = rng.uniform((5.0, 3.0, 0.0), (8.0, 6.0, 0.3), (9 * blades, 3))
    vertices = build_surface(np.vstack([floor, grass])).vertices
    amid = (np.abs(vertices[:, 0] - 6.5) < 1.2) & (np.abs(vertices[:, 1] - 4.5) < 1.2)
    assert (vertices[amid, 2] < 0.2).all()
