"""Facts about the cells of a grid that grid_map's tests publish; the number is in the test's name or id.

grid_map counts rows and columns from its upper right corner, against x and y. Ours count from the lower left one, so
positions are mirrored here and the published indices hold as they are.
"""

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_costmap_nav.grid.costmap import GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.rasterisation import rasterise_polygon
from mbf_costmap_nav.kernels.map.raytrace import clear_rays
from mbf_costmap_nav.map.layer import shifted
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap

EPSILON = 1e-9


def centred(width, height, resolution=1.0, x=0.0, y=0.0):
    return GridGeometry(width, height, resolution, x - 0.5 * width * resolution, y - 0.5 * height * resolution)


# ---------------------------------------------------------------------------------------------- cells and positions
@pytest.mark.parametrize(
    ("cell", "offset"), [((0, 0), (1, 0.5)), ((1, 0), (0, 0.5)), ((1, 1), (0, -0.5)), ((2, 1), (-1, -0.5))]
)
def test_f324_the_centre_of_a_cell_as_an_offset_from_the_maps(cell, offset):
    x, y = centred(3, 2, x=1.0, y=-2.0).cell_to_world(*cell)
    assert (1.0 - x, -2.0 - y) == pytest.approx(offset)


@pytest.mark.parametrize(
    ("offset", "cell"),
    [
        pytest.param((1, 0.5), (0, 0), id="F325-corner"),
        pytest.param((-1, -0.5), (2, 1), id="F325-far-corner"),
        pytest.param((0.6, 0.1), (0, 0), id="F325-first"),
        pytest.param((0.4, -0.1), (1, 1), id="F325-middle"),
        pytest.param((0.4, 0.1), (1, 0), id="F325-beside"),
        pytest.param((4, 0.5), None, id="F325-outside"),
        pytest.param((0, EPSILON), (1, 0), id="F326-above"),
        pytest.param((0.5 - EPSILON, -EPSILON), (1, 1), id="F326-below"),
        pytest.param((-0.5 - EPSILON, -EPSILON), (2, 1), id="F326-next"),
        pytest.param((-1.5, 1), None, id="F326-border"),
    ],
)
def test_the_cell_that_holds_a_position(offset, cell):
    assert centred(3, 2).world_to_cell(-offset[0], -offset[1]) == cell


@pytest.mark.parametrize(("x", "y", "inside"), [(1, 1.5, True), (1, -1.5, False), (-1, 1.5, False), (-1, -1.5, False)])
def test_f327_of_the_four_corners_of_a_map_one_lies_on_it(x, y, inside):
    assert centred(2, 3).contains(-x, -y) == inside


@pytest.mark.parametrize(("index", "clamped"), [(-1, 0), (10, 9), (35, 9), (-19, 0)])
def test_f331_indices_beyond_the_map_are_clamped_to_its_last_cells(index, clamped):
    grid = GridGeometry(10, 10, 1.0)
    assert grid.world_to_cell_clamped(index + 0.5, index + 0.5) == (clamped, clamped)


# --------------------------------------------------------------------------------------------------- rolling window
@pytest.mark.parametrize(
    ("shift", "cells", "resolution"),
    [((0.35, -0.45), (0, 0), 1), ((0.55, -0.45), (-1, 0), 1), ((-1.3, -2.65), (1, 3), 1), ((-0.4, 0.09), (2, 0), 0.2)],
)
def test_f329_a_window_moves_by_the_nearest_number_of_whole_cells(shift, cells, resolution):
    grid = centred(8, 8, resolution)
    window = LayeredCostmap(grid, [], Footprint([]), rolling_window=True)
    window.update(Pose.planar(*shift), 0.0)
    moved = window.geometry.origin_x - grid.origin_x, window.geometry.origin_y - grid.origin_y
    assert moved == pytest.approx((-cells[0] * resolution, -cells[1] * resolution))


@pytest.mark.parametrize(("cells", "shift"), [((1, -1), (-0.3, 0.3)), ((2, 1), (-0.6, -0.3))])
def test_f330_what_lies_in_a_window_keeps_its_place_when_the_window_moves(cells, shift):
    before = centred(8, 8, 0.3)
    after = centred(8, 8, 0.3, *shift)
    values = np.zeros((8, 8), dtype=np.uint8)
    values[4, 5] = 254
    moved = shifted(values, -cells[0], -cells[1], 255)
    ((iy, ix),) = np.argwhere(moved == 254)
    assert after.cell_to_world(int(ix), int(iy)) == pytest.approx(before.cell_to_world(5, 4))


# ------------------------------------------------------------------------------------------------- cells of an area
def covered(grid, corners):
    """Cells (ix, iy) that a polygon covers."""
    scaled = (-np.array(corners, dtype=float) - (grid.origin_x, grid.origin_y)) / grid.resolution
    x0, y0, mask = rasterise_polygon(scaled, grid.box)
    return {(int(ix) + x0, int(iy) + y0) for iy, ix in np.argwhere(mask)}


def rectangle(x, y, width, height):
    return [(x + sx * 0.5 * width, y + sy * 0.5 * height) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


@pytest.mark.parametrize(
    ("area", "first", "size", "centre"),
    [
        pytest.param((0, 0.5, 0.9, 2.9), (2, 0), (1, 3), (0, 0.5), id="F333"),
        pytest.param((2, 1.5, 2.9, 2.9), (0, 0), (2, 2), (1.5, 1), id="F334"),
        pytest.param((-1, -0.5, 0, 0), (3, 2), (1, 1), (-1, -0.5), id="F335"),
    ],
)
def test_the_cells_of_a_part_of_the_map(area, first, size, centre):
    grid = centred(5, 4)
    cells = covered(grid, rectangle(*area))
    assert cells == {(first[0] + i, first[1] + j) for i in range(size[0]) for j in range(size[1])}
    x, y = grid.cells_to_world(sorted(cells)).mean(axis=0)
    assert (-x, -y) == pytest.approx(centre)


def test_f341_the_cells_of_a_rectangle():
    # grid_map takes cells whose centre lies inside. Ours takes all that a footprint or a zone touches, so a side along
    # the border of two cells counts for the upper one as well; a rectangle a little smaller has the published cells.
    published = {(ix, iy) for ix in (3, 4) for iy in (1, 2, 3)}
    assert covered(centred(8, 5), rectangle(0, 0, 2 - EPSILON, 3 - EPSILON)) == published
    assert covered(centred(8, 5), rectangle(0, 0, 2, 3)) == {(ix, iy) for ix in (3, 4, 5) for iy in (1, 2, 3, 4)}


def test_f346_the_hull_of_points_and_of_two_squares_that_overlap():
    square, other = [(0, 0), (1, 1), (0, 1), (1, 0)], [(0.5, 0.5), (0.5, 1.5), (1.5, 0.5), (1.5, 1.5)]
    inner = [(0.2, 0.2), (0.8, 0.3), (0.5, 0.5), (0.3, 0.7)]
    assert len(Footprint(square + inner).offset(0.1).vertices) == 4
    hull = Footprint(square + other).offset(0.1).vertices
    assert len(hull) == 6
    assert inside_polygon(np.array([(0.5, 0.5), (0.01, 1.49)]), hull).tolist() == [True, False]


# --------------------------------------------------------------------------------------------------- cells of a line
def line(start, end):
    """Cells (ix, iy) of a ray on a map of 8 x 5 cells, in the order in which they lie along it."""
    cells = np.ones((5, 8), dtype=np.uint8)
    sensor, hit = np.array([-start[0], -start[1], 0.0]), np.array([[-end[0], -end[1], 0.0]])
    clear_rays(cells, np.array([-4.0, -2.5]), 1.0, sensor, hit, 0.0, 99.0, 0, np.zeros(4, dtype=np.int64))
    found = [(int(ix), int(iy)) for iy, ix in np.argwhere(cells == 0)]
    return sorted(found, key=lambda cell: -cell[0] if end[0] > start[0] else cell[0])


@pytest.mark.parametrize(
    ("start", "end", "count", "first"),
    [
        pytest.param((2, 2), (0, 0), 3, [(2, 0), (3, 1), (4, 2)], id="F336"),
        pytest.param((0, 0), (9, 6), 5, [(4, 2), (3, 1), (2, 1)], id="F337"),
        # grid_map steps along the line until it is on the map and misses the last of six columns: it has 5 cells.
        pytest.param((-7, -9), (8, 8), 6, [(5, 4), (4, 3), (3, 2)], id="F338"),
        pytest.param((-8, 8), (8, 8), 0, [], id="F339"),  # an error there
    ],
)
def test_the_part_of_a_line_that_lies_on_the_map(start, end, count, first):
    cells = line(start, end)
    assert len(cells) == count and cells[: len(first)] == first
