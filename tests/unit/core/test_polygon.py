"""Points inside polygons, against a loop over points and edges."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry.polygon import inside_polygon


def crossings_to_the_right(x, y, corners):
    """How many edges a ray along x from the point crosses."""
    count = 0
    for (x1, y1), (x2, y2) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            count += 1
    return count


@given(st.integers(0, 2**32 - 1), st.integers(3, 12))
@settings(max_examples=50, deadline=None)
def test_a_point_is_inside_where_a_ray_from_it_crosses_the_outline_an_odd_number_of_times(seed, count):
    rng = np.random.default_rng(seed)
    corners = rng.integers(-5, 6, (count, 2)).astype(np.float64)  # edges along the axes and equal corners happen
    points = rng.uniform(-6.0, 6.0, (40, 3))
    expected = [crossings_to_the_right(x, y, corners.tolist()) % 2 == 1 for x, y, _ in points.tolist()]
    assert inside_polygon(points, corners).tolist() == expected
