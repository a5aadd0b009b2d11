"""Groups of few obstacle cells are noise, wherever the box of an update cuts them and the window moves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, CellBox, Costmap
from mbf_costmap_nav.layers.denoise import small_groups
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap

SIZE = 4  # cells of the smallest group that is kept


def world(seed):
    """A fifth of the cells are obstacles."""
    return np.random.default_rng(seed).choice(np.array([FREE] * 4 + [LETHAL], dtype=np.uint8), (40, 40))


def rolling(cells):
    parameters = {"resolution": 1.0, "width": 20.0, "height": 16.0, "rolling_window": True, "robot_radius": 0.0}
    layers = [{"name": "walls", "type": "static"}, {"name": "denoise", "type": "denoise"}]
    return build_layered_costmap(
        CostmapParameters.model_validate(parameters | {"layers": layers}),
        {"denoise": {"minimal_group_size": SIZE}},
        static_map=Costmap(cells, 1.0, -20.0, -20.0),
    )


@given(st.integers(0, 99), st.integers(0, 12), st.integers(0, 12), st.integers(1, 8), st.integers(1, 8))
@settings(max_examples=40, deadline=None)
def test_a_box_is_freed_of_the_groups_that_are_small_on_the_whole_map(seed, x, y, width, height):
    costmap = rolling(world(seed))
    costmap.update(Pose.planar(0.0, 0.0), 0.0)
    layer, box = costmap.layers["denoise"], CellBox(x, y, x + width, y + height)
    seen, news = world(seed)[:16, :20], world(seed + 1)[:16, :20]
    layer.update_costs(seen.copy(), costmap.geometry.box)
    seen[box.slices] = news[box.slices]

    cells = seen.copy()
    layer.update_costs(cells, box)

    expected = np.where(small_groups(seen == LETHAL, SIZE, 8), FREE, seen)
    assert np.array_equal(cells[box.slices], expected[box.slices])
    cells[box.slices] = seen[box.slices]
    assert np.array_equal(cells, seen), "cells beside the box stay"


@pytest.mark.parametrize("seed", range(4))
def test_a_window_that_moves_is_denoised_as_a_new_one(seed):
    """But for cells at its borders, whose groups may have left it."""
    moved, (x, y) = rolling(world(seed)), (0, 0)
    for dx, dy in ((0, 0), (3, 0), (0, -2), (-5, 4)):
        x, y = x + dx, y + dy
        moved.update(Pose.planar(x, y), 0.0)
        fresh = rolling(world(seed))
        fresh.update(Pose.planar(x, y), 0.0)
        inner = (slice(SIZE, -SIZE), slice(SIZE, -SIZE))
        assert np.array_equal(moved.snapshot().cells[inner], fresh.snapshot().cells[inner])
    assert (fresh.snapshot().cells == LETHAL).any()
