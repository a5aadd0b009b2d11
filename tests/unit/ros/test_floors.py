"""Occupancy grids become floors, each cell as its naive twin has it, and what means nothing is refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_ros.messages.floors import floor_of, floor_window_of
from mbf_ros.messages.geometry import InvalidValueError, MessageContext
from mbf_ros.messages.interfaces import completed

CONTEXT = MessageContext("map", 100.0)


def grid(data, width, height, **info):
    info = {"resolution": 0.05, "width": width, "height": height, **info}
    return completed("nav_msgs/OccupancyGrid", {"header": {"frame_id": "/floor"}, "info": info, "data": data})


@given(st.integers(1, 5), st.integers(1, 5), st.data())
def test_each_cell_has_its_occupancy_at_its_place(width, height, data):
    cells = data.draw(st.lists(st.integers(-128, 127), min_size=width * height, max_size=width * height))
    floor = floor_of(grid(cells, width, height), CONTEXT)
    for row in range(height):
        for column in range(width):
            value = cells[row * width + column]
            expected = 255 if value == -1 else value if 0 <= value <= 100 else None
            found = int(floor.occupancy[row, column])
            assert found == expected if expected is not None else 100 < found < 255


def test_a_grid_lies_where_its_origin_is():
    turned = {"z": math.sin(0.25), "w": math.cos(0.25)}
    floor = floor_of(
        grid([0], 1, 1, origin={"position": {"x": 1.0, "y": -2.0, "z": 3.0}, "orientation": turned}), CONTEXT
    )
    assert (floor.resolution, floor.origin_x, floor.origin_y, floor.frame_id) == (0.05, 1.0, -2.0, "floor")
    assert floor.yaw == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (grid([0] * 5, 2, 3), "data: expected 2 x 3 cells, at least one, got 5"),
        (grid([], 0, 0), "data: expected 0 x 0 cells, at least one, got 0"),
        (grid([0], 2**32 - 1, 2**32 - 1), "data: expected 4294967295 x 4294967295 cells, at least one, got 1"),
        (grid([0], 1, 1, resolution=math.nan), "info.resolution: expected 0.0001 to 1000 m, got nan"),
        (grid([0], 1, 1, resolution=-0.05), "got -0.05"),
        (grid([0], 1, 1, resolution=math.inf), "got inf"),
        (grid([0], 1, 1, origin={"position": {"x": math.nan, "y": 0.0}, "orientation": {"w": 1.0}}), "info.origin: "),
        (
            grid([0], 1, 1, origin={"position": {"x": 0.0, "y": 0.0}, "orientation": {"w": 0.0}}),
            r"info.origin: the quaternion \(0, 0, 0, 0\)",
        ),
    ],
)
def test_a_grid_that_means_nothing_is_refused(message, text):
    with pytest.raises(InvalidValueError, match=text):
        floor_of(message, CONTEXT)


def test_an_update_is_a_window_of_its_grid():
    values = {"x": 3, "y": 4, "width": 2, "height": 1, "data": [100, -1]}
    window = floor_window_of(completed("map_msgs/OccupancyGridUpdate", values), CONTEXT)
    assert (window.x, window.y, window.frame_id) == (3, 4, "map")
    assert window.occupancy.tolist() == [[100, 255]]
    with pytest.raises(InvalidValueError, match="data: expected 3 x 1 cells, at least one, got 2"):
        floor_window_of(completed("map_msgs/OccupancyGridUpdate", {**values, "width": 3}), CONTEXT)


def test_cells_as_typed_arrays_are_those_of_lists():
    cells = [0, 100, -1, 50]
    listed, typed = grid(cells, 2, 2), grid(np.array(cells, np.int8), 2, 2)
    assert floor_of(listed, CONTEXT).equals(floor_of(typed, CONTEXT))
