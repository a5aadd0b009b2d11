"""How deep lethal cells lie within an outline: the kernel against its definition, and along motions."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry.polygon import inside_polygon
from mbf_costmap_nav.kernels.map.penetration import NOT_NEAR, penetration

BOX = np.array([[4.0, 3.0], [9.0, 3.0], [9.0, 7.0], [4.0, 7.0]])


def naive(cells, corners):
    depths = [NOT_NEAR]
    for row, column in np.argwhere(cells == 254):
        centre, ends = np.array([column + 0.5, row + 0.5]), np.roll(corners, -1, axis=0)
        shares = np.linspace(0.0, 1.0, 20001)[:, None]
        gap = min(np.hypot(*(a + shares * (b - a) - centre).T).min() for a, b in zip(corners, ends, strict=True))
        depths.append(gap if inside_polygon(centre[None], corners)[0] else -gap)
    return max(depths)


@given(seed=st.integers(0, 10**6), yaw=st.floats(-3.0, 3.0), x=st.floats(-2.0, 3.0), y=st.floats(-2.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_it_is_the_distance_from_the_nearest_side_of_the_deepest_centre(seed, yaw, x, y):
    cells = np.where(np.random.default_rng(seed).random((12, 14)) < 0.05, 254, 253).astype(np.uint8)
    middle = np.array([6.5, 5.0])
    turned = (BOX - middle) @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + middle + (x, y)
    assert abs(penetration(cells, turned) - naive(cells, turned)) < 1e-3


def test_a_pole_gets_deeper_until_it_is_in_the_middle_and_only_lethal_cells_within_reach_count():
    cells = np.full((12, 30), 255, dtype=np.uint8)
    cells[4, 20] = 254
    depths = [penetration(cells, BOX + np.array([step, 0.0])) for step in (9.0, 11.0, 11.5, 12.0, 12.5, 13.0, 14.0)]
    assert depths == [NOT_NEAR, -0.5, 0.0, 0.5, 1.0, 1.5, 1.5]
    assert penetration(cells, np.array([[20.5, 4.5]])) == 0.0, "a point robot on it"
    assert penetration(cells, np.array([[20.0, 4.5]])) == -0.5
