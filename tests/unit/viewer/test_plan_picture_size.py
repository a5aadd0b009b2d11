"""The picture of a plan on a large map shows blocks of cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.maps.view import GridView
from terrain.viewer.pictures.plan_picture import shrunk


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(1, 40), width=st.integers(1, 40), most=st.integers(1, 12))
def test_each_block_has_the_highest_cost_of_its_cells_where_they_lie(seed, height, width, most):
    rng = np.random.default_rng(seed)
    costs = rng.choice(np.array([0.0, 0.4, 1.0, np.nan, np.inf], np.float32), (height, width))
    view = GridView(costs, (-3.0, -3.0 + 0.5 * width, 2.0, 2.0 + 0.5 * height))
    small = shrunk(view, most)
    rows, columns = small.costs.shape
    side = (small.extent[1] - small.extent[0]) / columns / 0.5
    assert max(rows, columns) <= most and side == pytest.approx(round(side))
    assert (small.extent[3] - small.extent[2]) / rows / 0.5 == pytest.approx(side)
    for row in range(rows):
        for column in range(columns):
            low_x, low_y = column * round(side), row * round(side)
            block = costs[low_y : low_y + round(side), low_x : low_x + round(side)]
            known = block[~np.isnan(block)]
            expected = known.max() if known.size else np.nan
            assert np.array_equal(small.costs[row, column], expected, equal_nan=True)


def test_a_small_map_is_shown_as_it_is():
    view = GridView(np.zeros((3, 5), np.float32), (0.0, 1.0, 0.0, 1.0))
    assert shrunk(view, 5) is view
