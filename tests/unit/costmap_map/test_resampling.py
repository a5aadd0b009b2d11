"""A map under another grid: the value at each centre, and no wall or line gets lost, however thin."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

from mbf_abstract.geometry import Pose, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, UNKNOWN, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.resampling import sample_costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap


def one_by_one(source, grid, box, outside, T_source_grid=None):
    """The slow way: the value at each centre, then each cost of a finer or turned map where its own centre lies."""
    there = T_source_grid or Transform((0.0, 0.0, 0.0), parent=source.frame_id, child="grid")

    def cell(of, x, y):
        """A point on a border, or a rounding error below it, lies in the upper cell."""
        return tuple(
            math.floor((at - lower) / of.resolution + 1e-6) for at, lower in ((x, of.origin_x), (y, of.origin_y))
        )

    values = np.full((box.y1 - box.y0, box.x1 - box.x0), outside, dtype=np.uint8)
    for iy, ix in np.ndindex(*values.shape):
        x, y = there.apply([(*grid.cell_to_world(ix + box.x0, iy + box.y0), 0.0)])[0, :2]
        column, row = cell(source, x, y)
        if 0 <= column < source.width and 0 <= row < source.height:
            values[iy, ix] = source.cost(column, row)
    if T_source_grid is None and source.resolution >= grid.resolution:
        return values  # a centre lies in every cell of the source
    for iy, ix in np.argwhere((source.cells != FREE) & (source.cells != UNKNOWN)):
        x, y = there.inverse().apply([(*source.cell_to_world(ix, iy), 0.0)])[0, :2]
        column, row = cell(grid, x, y)
        column, row = column - box.x0, row - box.y0
        if 0 <= column < values.shape[1] and 0 <= row < values.shape[0]:
            known = 0 if values[row, column] == UNKNOWN else values[row, column]
            values[row, column] = max(known, source.cells[iy, ix])
    return values


SIDES = st.floats(0.031, 0.4)
OFFSETS = st.floats(-1.0, 1.0)


@given(SIDES, SIDES, OFFSETS, OFFSETS, st.one_of(st.none(), st.floats(-math.pi, math.pi)), st.integers(0, 99))
@example(0.4, 0.4, -1.0, 0.0, None, 1)  # centres of one on the borders of the other, of equal cells and of others
@example(0.2, 0.2, -1.0, -1.0, None, 1)
@example(0.2, 0.4, -1.0, -1.0, None, 1)
@example(0.2, 0.2, -1.0, -1.0, 0.0, 1)
@example(0.4, 0.2, -1.0, -1.0, 0.0, 1)
@example(0.2, 0.4, -0.5, -1.0, -math.pi / 2, 1)
@settings(max_examples=60, deadline=None)
def test_it_is_the_same_as_looked_up_one_by_one(fine, coarse, x, y, yaw, seed):
    values = np.array([FREE, FREE, FREE, UNKNOWN, 17, 200, LETHAL], dtype=np.uint8)
    source = Costmap(np.random.default_rng(seed).choice(values, (14, 18)), fine, x, y)
    grid, box = GridGeometry(12, 9, coarse, -0.3, -0.2), CellBox(1, 2, 11, 8)
    turn = None if yaw is None else Transform((y, x, 0.0), quaternion_from_yaw(yaw), "map", "grid")
    assert np.array_equal(
        sample_costmap(source, grid, box, UNKNOWN, turn), one_by_one(source, grid, box, UNKNOWN, turn)
    )


@pytest.mark.parametrize("wall", range(40))
@pytest.mark.parametrize("resolution", [0.07, 0.1, 0.125, 0.15])
def test_a_wall_one_cell_wide_stays_a_wall_on_every_coarser_grid(wall, resolution):
    cells = np.zeros((40, 40), dtype=np.uint8)
    cells[wall] = LETHAL
    grid = GridGeometry(math.ceil(2.0 / resolution), math.ceil(2.0 / resolution), resolution)
    sampled = sample_costmap(Costmap(cells, 0.05), grid, grid.box, UNKNOWN) == LETHAL
    assert sampled.any(axis=0).sum() >= int(2.0 / resolution) and sampled.any(axis=1).sum() == 1


@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1, 0.3])
@pytest.mark.parametrize("halves", range(-15, 16))
def test_a_wall_one_cell_wide_stays_so_on_a_grid_that_lies_half_a_cell_beside(halves, resolution):
    grid = GridGeometry(60, 10, resolution, -25.0 * resolution)
    for wall in range(18):
        cells = np.zeros((14, 18), dtype=np.uint8)
        cells[:, wall] = LETHAL
        source = Costmap(cells, resolution, halves * resolution / 2)
        assert (sample_costmap(source, grid, grid.box, UNKNOWN) == LETHAL).any(axis=0).sum() == 1


@pytest.fixture
def painted(tmp_path):
    """``painted(row)`` writes a mask of 5 m x 5 m at 0.05 m with one line of a pixel, and returns its folder."""

    def paint(row):
        grey = np.full((100, 100), 254, dtype=np.uint8)
        grey[row] = 0
        Image.fromarray(grey).save(tmp_path / "line.pgm")
        (tmp_path / "line.yaml").write_text("image: line.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
        return tmp_path

    return paint


@pytest.mark.parametrize("row", [50, 51])
@pytest.mark.parametrize("rolling", [False, True])
@pytest.mark.parametrize(("layer", "key"), [("keepout", "mask_file"), ("static", "map_file")])
def test_a_line_of_one_pixel_keeps_out_on_a_coarser_map(painted, layer, key, rolling, row):
    parameters = CostmapParameters.model_validate(
        {"resolution": 0.1, "width": 4.0, "height": 4.0, "rolling_window": rolling, "frame_id": "map"}
        | {"layers": [{"name": "grid", "type": "obstacle"}, {"name": "line", "type": layer}]}
    )
    costmap = build_layered_costmap(parameters, {"line": {key: "line.yaml"}}, base_folder=painted(row))
    for x in (2.0, 2.3, 2.5):
        costmap.update(Pose.planar(x, 2.5), 0.0)
        assert (costmap.snapshot().cells == LETHAL).any(axis=0).all()


@given(st.lists(st.tuples(st.integers(-7, 7), st.integers(-7, 7)), min_size=1, max_size=5), st.sampled_from([2, 3, 4]))
@settings(max_examples=25, deadline=None)
def test_a_finer_map_under_a_rolling_window_is_the_same_as_sampled_anew(moves, finer):
    cells = np.random.default_rng(5).choice(np.array([0, 0, 0, 90, 254, 255], dtype=np.uint8), (60, 60))
    world = Costmap(cells, 0.3 / finer * 2 / 3, -2.0, -2.0)
    parameters = CostmapParameters.model_validate(
        {"resolution": 0.3, "width": 2.4, "height": 1.8, "rolling_window": True, "track_unknown_space": True}
        | {"layers": [{"name": "walls", "type": "static"}]}
    )
    rolled = build_layered_costmap(parameters, static_map=world)
    x = y = 0.0
    for dx, dy in moves:
        x, y = x + 0.3 * dx, y + 0.3 * dy
        fresh = build_layered_costmap(parameters, static_map=world)
        for costmap in (rolled, fresh):
            costmap.update(Pose.planar(x, y), 0.0)
        assert np.array_equal(rolled.snapshot().cells, fresh.snapshot().cells)
