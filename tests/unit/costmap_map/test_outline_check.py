"""Which polygons a configuration may give as the robot's outline."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.costmap_config import CostmapParameters


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        ([(1, 1), (-1, -1), (1, -1), (-1, 1)], "do not cross"),
        ([(2, 1), (-1, 1), (-1, -1), (2, -1), (-1, 0.5)], "do not cross"),
        ([(1, 0), (0, 0), (-1, 0)], "area"),
        ([(0, 0), (0, 0), (0, 0)], "area"),
        ([(1, 1), (2, 1), (2, 2), (1, 2)], "lies outside"),
        ([(1e300, 0), (0, 1e300), (-1, -1)], r"within 1e\+06 m of the base, not 1e\+300 m"),
    ],
)
def test_what_is_no_outline_around_the_base_is_refused(corners, reason):
    with pytest.raises(ValueError, match=reason):
        Footprint.parse(corners)
    with pytest.raises(ValidationError, match=reason):
        CostmapParameters(footprint=corners)


@pytest.mark.parametrize(
    "corners",
    [
        [(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)],
        [(0.75, 0.3), (0, 0.3), (0, -0.3), (0.75, -0.3)],
        [(1, 1), (0, 0), (-1, 1), (-1, -1), (1, -1)],
    ],
    ids=["closed by its first corner", "base on a side", "notched, base on a corner"],
)
def test_an_outline_may_be_closed_and_have_the_base_on_its_border(corners):
    assert len(Footprint.parse(corners).vertices) == len(corners)


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 12), clockwise=st.booleans())
def test_every_star_around_the_base_is_an_outline_and_none_that_is_moved_away(seed, count, clockwise):
    rng = np.random.default_rng(seed)
    angles = (np.arange(count) + rng.uniform(0.1, 0.8, count)) * (2.0 * math.pi / count)
    corners = rng.uniform(0.3, 2.0, (count, 1)) * np.column_stack([np.cos(angles), np.sin(angles)])
    corners = corners[::-1] if clockwise else corners
    turns = np.diff(np.append(angles, angles[0] + 2.0 * math.pi))
    if turns.max() < math.pi:
        assert Footprint.parse(corners.tolist()) is not None
    with pytest.raises(ValueError, match="outside"):
        Footprint.parse(np.add(corners, (0.0, 2.5)).tolist())
