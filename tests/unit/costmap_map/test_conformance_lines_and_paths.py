"""Facts about lines, areas and path checks that other packages' tests publish (F071, F074, F156, F174-F178, F342)."""

import json

import numpy as np
import pytest

from mbf_abstract.geometry import Path
from mbf_abstract.maps.map_queries import check_path
from mbf_abstract.maps.queries import CellState
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.zones import Zone
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon
from mbf_costmap_nav.kernels.map.raytrace import clear_rays
from mbf_costmap_nav.map.pose_checks import pose_check


def line(x0, y0, x1, y1):
    """Cells of a ray from one cell's centre to another's, on a grid that begins at (-5, -5)."""
    cells = np.ones((20, 20), dtype=np.uint8)
    sensor, end = np.array([x0 + 0.5, y0 + 0.5, 0.0]), np.array([[x1 + 0.5, y1 + 0.5, 0.0]])
    clear_rays(cells, np.array([-5.0, -5.0]), 1.0, sensor, end, 0.0, 99.0, 0, np.zeros(4, dtype=np.int64))
    return sorted((int(ix) - 5, int(iy) - 5) for iy, ix in np.argwhere(cells == 0))


def test_f071_a_diagonal_has_eleven_cells():
    cells = line(0, 0, 10, 10)
    assert len(cells) == 11 and cells[5] == (5, 5)


def test_f074_a_steep_line_into_the_negative():
    assert line(0, 0, -2, -4) == sorted([(0, 0), (-1, -1), (-1, -2), (-2, -3), (-2, -4)])


def test_f156_points_beside_an_l_shape_are_outside():
    corners = ((-1.0, -1.0), (1.0, -1.0), (1.0, 0.5), (0.5, 0.5), (0.5, 1.0), (-1.0, 1.0))
    zone = Zone(name="L", polygon=corners)
    assert zone.contains(0.0, 0.0)
    assert not any(zone.contains(x, y) for x in (-3.0, -2.0, 2.0, 3.0) for y in (-1.0, 0.5, 1.0))


def test_f342_a_polygon_over_everything_and_one_far_away():
    box = (0, 0, 8, 5)
    _, _, everything = rasterise_polygon(np.array([(-9.0, -9.0), (99.0, -9.0), (99.0, 99.0), (-9.0, 99.0)]), box)
    _, _, nothing = rasterise_polygon(np.array([(50.0, 50.0), (51.0, 50.0), (51.0, 51.0)]), box)
    assert np.count_nonzero(everything) == 40 and np.count_nonzero(nothing) == 0


@pytest.fixture
def nav2_map(shared_data):
    values = {"o": 0, "u": 100, "i": 253, "x": 254, "n": 255}
    maps = json.loads((shared_data / "maps" / "nav2_test_costmaps.json").read_text())["maps"]

    def load(name):
        return Costmap(np.array([[values[cell] for cell in row] for row in maps[name]], dtype=np.uint8), 1.0)

    return load


def cells_path(cells):
    return Path.from_points([(x + 0.5, y + 0.5, 0.0) for x, y in cells])


def test_f174_a_path_over_all_cells_meets_the_obstacle(nav2_map):
    path = cells_path([(x, y) for y in range(10) for x in range(10)])
    answer = check_path(pose_check(nav2_map("top_left_obstacle"), Footprint([])), path, return_on=CellState.LETHAL)
    assert answer.state >= CellState.LETHAL and 0 <= answer.last_checked < 99


def test_f175_f176_f177_a_column_of_free_and_unknown_cells(nav2_map):
    answer = check_path(
        pose_check(nav2_map("top_left_obstacle"), Footprint([])), cells_path([(1, y) for y in range(10)])
    )
    assert answer.state is CellState.UNKNOWN, "no lethal cell, but an unknown one"
    assert answer.cost > 0


def test_f178_a_footprint_along_a_row_of_the_open_map(nav2_map):
    footprint = Footprint.parse("[[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]]")
    path = Path.from_points([(x + 0.5, 5.5, 0.0) for x in range(1, 9)])
    assert check_path(pose_check(nav2_map("open_space"), footprint), path).state is CellState.FREE
