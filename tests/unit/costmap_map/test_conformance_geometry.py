"""Facts of upstream unit tests about footprints, coordinates and voxels (F031-F047, F061-F063, F347)."""

import math
import sys

import numpy as np
import pytest

from mbf_costmap_nav.grid.collision import footprint_costs
from mbf_costmap_nav.grid.costmap import Costmap, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint, parse_number_lists
from mbf_costmap_nav.kernels.map.voxel import clear_voxel_line, count_bits, mark_voxels
from mbf_costmap_nav.map.costmap_config import CostmapParameters

SQUARE = Footprint([(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)])
DIAMOND = Footprint([(0.0, 0.5), (0.5, 0.0), (0.0, -0.5), (-0.5, 0.0)])


def test_f031_padding_moves_vertices_by_the_sign_of_their_coordinates():
    padded = Footprint([(1, 1), (-1, 1), (-1, -1)]).padded(0.5)
    assert padded.vertices.tolist() == [[1.5, 1.5], [-1.5, 1.5], [-1.5, -1.5]]


def test_f032_a_round_robot_has_sixteen_points():
    vertices = Footprint.circle(10.0).vertices
    assert len(vertices) == 16
    assert vertices[0] == pytest.approx((10.0, 0.0)) and vertices[4] == pytest.approx((0.0, 10.0))


def test_f033_without_configuration_the_radius_is_0_46_plus_padding():
    parameters = CostmapParameters()
    vertices = parameters.robot_footprint().padded(parameters.footprint_padding).vertices
    assert len(vertices) == 16 and vertices[0, 0] == pytest.approx(0.47)


@pytest.mark.parametrize("value", ["[[1, 2], [3]]", "[[1, 2, 3], [1, 2, 3], [4, 5, 6]]", "[1, 2, 3]"], ids=str)
def test_f034_a_malformed_list_is_refused(value):
    with pytest.raises(ValueError, match=r"footprint|list"):
        CostmapParameters(footprint=value).robot_footprint()


def test_f035_number_lists_are_parsed():
    assert parse_number_lists("[[1, 2.2], [.3, -4e4]]") == [[1, 2.2], [0.3, -40000]]


@pytest.mark.parametrize("text", ["[1, 2.2], [.3, -4e4]]", "[[1, 2.2], [.3, -4e4]", "[1, 2.2, .3, -4e4]"])
def test_f036_broken_number_lists_are_refused(text):
    with pytest.raises(ValueError, match="expected a list"):
        parse_number_lists(text)


def map_100(value=0):
    return Costmap(np.full((100, 100), value, dtype=np.uint8), 0.1)


def test_f037_an_empty_map_costs_nothing():
    costs = footprint_costs(map_100(), DIAMOND, 5.0, 5.0, 0.0)
    assert costs.lethal == 0 and costs.weighted_sum() == 0


@pytest.mark.parametrize(("x", "y", "highest"), [(5.0, 5.0, 0), (5.0, 4.9, 254), (5.0, 5.2, 254)])
def test_f038_a_square_in_a_square_hole(x, y, highest):
    costmap = map_100(254)
    costmap.cells[40:61, 40:61] = 0
    assert footprint_costs(costmap, SQUARE, x, y, 0.0).highest == highest


@pytest.mark.parametrize(("x", "y", "highest"), [(5.0, 5.0, 0), (4.9, 5.0, 254), (5.2, 5.0, 254)])
def test_f039_lethal_cells_just_beside_a_square(x, y, highest):
    costmap = map_100()
    costmap.cells[50, 62] = costmap.cells[60, 39] = 254
    assert footprint_costs(costmap, SQUARE, x, y, 0.0).highest == highest


def test_f040_the_cost_of_a_point():
    costmap = map_100()
    costmap.cells[50, 50] = 200
    assert costmap.cost_at(5.0, 5.0) == 200


def test_f041_two_points_have_no_radii():
    footprint = Footprint([(1, 1), (2, 2)])
    assert footprint.inscribed_radius == sys.float_info.max and footprint.circumscribed_radius == 0.0


@pytest.mark.parametrize("text", ["[[bad_string", "[[1, 2.2], [.3, -4e4]]", "[[1, 2.2], [.3, -4e4], [-.3, -4e4, 1]]"])
def test_f042_bad_footprint_strings_are_refused(text):
    with pytest.raises(ValueError, match=r"expected|footprint"):
        Footprint.parse(text)


def test_f042_a_good_footprint_string_is_taken():
    assert len(Footprint.parse("[[1, 2.2], [.3, -4e4], [-.3, -4e4], [-1, 2.2]]").vertices) == 4


UNIT = GridGeometry(2, 3, 1.0)
TENTH = GridGeometry(2, 3, 0.1, -0.2, 0.2)


@pytest.mark.parametrize(
    ("grid", "cell", "world"),
    [
        pytest.param(UNIT, (0, 0), (0.5, 0.5), id="F043-first"),
        pytest.param(UNIT, (1, 2), (1.5, 2.5), id="F043-last"),
        pytest.param(TENTH, (0, 0), (-0.15, 0.25), id="F046-first"),
        pytest.param(TENTH, (1, 2), (-0.05, 0.45), id="F046-last"),
    ],
)
def test_centres_of_cells(grid, cell, world):
    assert grid.cell_to_world(*cell) == pytest.approx(world)
    assert grid.cells_to_world([cell])[0] == pytest.approx(world)
    assert grid.world_to_cell(*world) == cell


@pytest.mark.parametrize(
    ("x", "ix"), [(0.0, 0), (0.25, 0), (0.75, 0), (0.9999, 0), (1.0, 1), (1.25, 1), (1.75, 1), (1.9999, 1)]
)
def test_f044_points_belong_to_the_cell_they_lie_in(x, ix):
    assert UNIT.world_to_cell(x, 0.0) == (ix, 0)


def test_f044_f045_f047_points_out_of_the_grid():
    assert UNIT.world_to_cell(2.0, 0.0) is None and UNIT.world_to_cell_clamped(2.0, 0.0) == (1, 0)
    assert UNIT.world_to_cell(2.5, 2.5) is None
    assert UNIT.world_to_cell_clamped(2.5, 2.5) == (1, 2) and UNIT.world_to_cell_unbounded(2.5, 2.5) == (2, 2)
    assert TENTH.world_to_cell_unbounded(2.5, 0.3)[0] == 27 and TENTH.world_to_cell_clamped(2.5, 0.3)[0] == 1


LEVELS = 16


@pytest.fixture
def table():
    """F061's grid: 50 x 10 x 16 voxels with a table at z = 12."""
    marked, seen = np.zeros((10, 50), dtype=np.uint32), np.zeros((10, 50), dtype=np.uint32)
    points = np.array([(x + 0.5, y + 0.5, 12.5) for x in range(5, 16) for y in range(4)])
    mark_voxels(
        marked, seen, LEVELS, np.zeros(3), np.ones(3), np.zeros(3), points, np.ones(len(points), dtype=bool),
        0.0, 100.0, np.zeros(4, dtype=np.int64),
    )  # fmt: skip
    return marked, seen


def bits(columns):
    return sum(count_bits(word) for word in columns.ravel())


def test_f061_a_table_of_voxels(table):
    marked, seen = table
    assert bits(marked) == 44 and bits(seen) == 44, "all other voxels are unknown"


def test_f062_clearing_a_line_frees_eleven_voxels(table):
    marked, seen = table
    clear_voxel_line(marked, seen, np.array([5, 0, 12]), np.array([15, 0, 12]))
    assert (bits(marked), bits(seen & ~marked), bits(seen)) == (33, 11, 44)


def test_f063_a_column_is_marked_and_cleared():
    marked, seen = np.zeros((10, 50), dtype=np.uint32), np.zeros((10, 50), dtype=np.uint32)
    marked[0, 0] = seen[0, 0] = (1 << LEVELS) - 1
    clear_voxel_line(marked, seen, np.array([0, 0, 0]), np.array([0, 0, 15]))
    assert marked[0, 0] == 0 and seen[0, 0] == (1 << LEVELS) - 1


def test_f292_safety_padding_of_a_triangle_and_the_offset_we_use_instead():
    triangle = Footprint([(1, 1), (-1, 1), (-1, -1)])
    assert np.abs(triangle.padded(0.1).vertices).max() == pytest.approx(1.1)
    assert np.abs(triangle.padded(0.5).padded(0.1).vertices).max() == pytest.approx(1.6)
    grown = triangle.offset(0.1)
    assert grown.inscribed_radius == pytest.approx(0.1, abs=1e-9), "the long side passed through the base"
    assert math.hypot(*(grown.vertices.max(axis=0) - 1.0)) >= 0.1


def test_many_points_get_the_cells_that_single_points_get():
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (200, 2))
    cells, inside = TENTH.world_to_cells(points)
    for point, cell, is_inside in zip(points, cells, inside, strict=True):
        assert TENTH.world_to_cell(*point) == (tuple(cell.tolist()) if is_inside else None)
