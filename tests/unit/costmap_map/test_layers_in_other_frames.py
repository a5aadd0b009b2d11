"""Static maps, zones and masks in another frame than their costmap's: every cell where it belongs."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_costmap_nav.files.map_io import OccupancyMap
from mbf_costmap_nav.files.map_saver import save_map
from mbf_costmap_nav.grid.costmap import LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.grid.resampling import ON_A_BORDER
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap

WORLD = Costmap(np.random.default_rng(3).integers(0, 254, (20, 30)).astype(np.uint8), 0.5, -4.0, -6.0)
WALLS = {"resolution": 0.25, "width": 9.0, "height": 7.0, "frame_id": "odom", "track_unknown_space": True} | {
    "layers": [{"name": "walls", "type": "static"}]
}


def odom_at(x, y, yaw):
    return Transform((x, y, 0.0), quaternion_from_yaw(yaw), "map", "odom", static=True)


def place(world=WORLD, *, odom=None, **settings):
    """A costmap in odom over a world in map, and the transforms it looks at."""
    transforms = TransformBuffer()
    if odom is not None:
        transforms.set(odom)
    parameters = CostmapParameters.model_validate(WALLS | settings)
    return build_layered_costmap(parameters, static_map=world, transforms=transforms), transforms


def looked_up_one_by_one(world, costmap, odom):
    """The slow way: the world's cell at the centre of each cell of the costmap."""
    cells = np.full((costmap.geometry.height, costmap.geometry.width), UNKNOWN, dtype=np.uint8)
    for iy, ix in np.ndindex(*cells.shape):
        x, y = costmap.geometry.cell_to_world(ix, iy)
        there = odom.apply_to_pose(Pose.planar(x, y, frame_id="odom"))
        nudge = ON_A_BORDER * world.resolution  # on a border, or a rounding error below it: the upper cell
        cost = world.cost_at(there.x + nudge, there.y + nudge)
        cells[iy, ix] = UNKNOWN if cost is None else cost
    return cells


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
@example(0.98, 0.0, 0.98)  # a centre of the costmap lies on a border of the world's cells, but for rounding
@settings(max_examples=20, deadline=None)
def test_each_cell_shows_the_map_at_its_centre(x, y, yaw):
    odom = odom_at(x, y, yaw)
    costmap, _ = place(odom=odom)
    costmap.update(None, 0.0)
    assert np.array_equal(costmap.snapshot().cells, looked_up_one_by_one(WORLD, costmap, odom))


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-math.pi, math.pi))
@settings(max_examples=20, deadline=None)
def test_no_lethal_cell_gets_lost_in_a_turned_map(x, y, yaw):
    cells = np.zeros((12, 12), dtype=np.uint8)
    cells[3:9:3, 3:9:3] = LETHAL  # single cells, as small as those of the costmap
    world, odom = Costmap(cells, 0.25, -1.5, -1.5), odom_at(x, y, yaw)
    costmap, _ = place(world, odom=odom, origin_x=-4.0, origin_y=-3.5)
    costmap.update(None, 0.0)
    for iy, ix in np.argwhere(cells == LETHAL):
        there = odom.inverse().apply_to_pose(Pose.planar(*world.cell_to_world(ix, iy)))
        assert costmap.snapshot().cost_at(there.x, there.y) == LETHAL


@given(st.lists(st.tuples(st.integers(-12, 12), st.integers(-12, 12)), min_size=1, max_size=4))
@settings(max_examples=15, deadline=None)
def test_a_turned_map_under_a_rolling_window_is_the_same_as_sampled_anew(moves):
    odom = odom_at(0.3, -0.2, 0.7)
    rolled, _ = place(odom=odom, rolling_window=True)
    x = y = 0.0
    for dx, dy in moves:
        x, y = x + 0.25 * dx, y + 0.25 * dy
        fresh, _ = place(odom=odom, rolling_window=True)
        for costmap in (rolled, fresh):
            costmap.update(Pose.planar(x, y, frame_id="odom"), 0.0)
        assert np.array_equal(rolled.snapshot().cells, fresh.snapshot().cells)


def test_the_map_follows_its_frame():
    costmap, transforms = place(odom=Transform((0.0, 0.0, 0.0), parent="map", child="odom", stamp=0.0))
    costmap.update(None, 0.0)
    moved = Transform((1.0, 0.5, 0.0), parent="map", child="odom", stamp=1.0)
    transforms.set(moved)
    costmap.update(None, 1.0)
    assert np.array_equal(costmap.snapshot().cells, looked_up_one_by_one(WORLD, costmap, moved))


def test_while_the_frame_is_unknown_the_map_is_not_current_and_empty():
    costmap, transforms = place()
    costmap.update(None, 0.0)
    assert "'walls'" in costmap.stale_reason(0.0) and "odom" in costmap.stale_reason(0.0)
    assert (costmap.snapshot().cells == UNKNOWN).all()
    transforms.set(odom_at(0.0, 0.0, 0.0))
    costmap.update(None, 0.1)
    assert not costmap.stale_reason(0.1) and not (costmap.snapshot().cells == UNKNOWN).all()


def test_clearing_returns_to_the_placed_map():
    costmap, _ = place(odom=odom_at(0.3, -0.2, 0.7))
    costmap.update(None, 0.0)
    before = costmap.snapshot().cells
    costmap.clear_area(Pose.planar(2.0, 1.0), 2.0, layer_names=["walls"], inside=True)
    costmap.update(None, 0.1)
    assert not np.array_equal(costmap.snapshot().cells, before)
    costmap.clear()
    costmap.update(None, 0.2)
    assert np.array_equal(costmap.snapshot().cells, before)


def test_a_map_in_another_frame_does_not_give_the_costmap_its_grid():
    costmap, _ = place()
    assert (costmap.geometry.width, costmap.geometry.height) == (36, 28)


@pytest.mark.parametrize("frame", ["", "map"])
def test_a_map_file_has_the_frame_it_is_given(frame, tmp_path):
    save_map(tmp_path / "walls.yaml", OccupancyMap(np.zeros((4, 4), dtype=np.uint8), 1.0))
    block = {"map_file": "walls.yaml", "map_frame": frame}
    costmap = build_layered_costmap(
        CostmapParameters.model_validate(WALLS), {"walls": block}, base_folder=tmp_path, transforms=TransformBuffer()
    )
    costmap.update(None, 0.0)
    assert (not costmap.stale_reason(0.0)) == (frame == "")


# ------------------------------------------------------------------------------------------- zones and masks
ROOM = [[1.0, 1.0], [3.0, 1.0], [3.0, 2.0], [1.0, 2.0]]
INSIDE, OUTSIDE = Pose.planar(2.9, 1.1), Pose.planar(1.1, 2.9)


def filters(tmp_path, odom=None):
    """Keep-out and speed-limit layers whose zone and mask are given in map, on a costmap in odom."""
    painted = np.zeros((4, 4), dtype=np.uint8)
    painted[0, 3] = 100  # the cell from (3, 0) to (4, 1)
    save_map(tmp_path / "mask.yaml", OccupancyMap(painted, 1.0))
    zone = {"name": "room", "polygon": ROOM, "speed_limit": 0.2}
    block = {"zones": [zone], "mask_file": "mask.yaml", "map_frame": "map"}
    layers = [{"name": "keepout", "type": "keepout"}, {"name": "slow", "type": "speed_limit"}]
    transforms = TransformBuffer()
    if odom is not None:
        transforms.set(odom)
    parameters = CostmapParameters.model_validate(WALLS | {"layers": layers, "origin_x": -4.5, "origin_y": -3.5})
    blocks = {"keepout": block, "slow": block | {"limit_type": "percent"}}
    return build_layered_costmap(parameters, blocks, base_folder=tmp_path, transforms=transforms), transforms


def on(odom, pose):
    there = odom.inverse().apply_to_pose(pose)
    return there.x, there.y


@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.0])
def test_keepout_zones_and_masks_lie_where_their_frame_does(tmp_path, yaw):
    odom = odom_at(1.5, 0.5, yaw)
    costmap, _ = filters(tmp_path, odom)
    costmap.update(None, 0.0)
    forbidden, in_mask = Pose.planar(2.0, 1.5), Pose.planar(3.5, 0.5)
    assert [costmap.snapshot().cost_at(*on(odom, pose)) for pose in (forbidden, in_mask)] == [LETHAL, LETHAL]
    assert costmap.snapshot().cost_at(*on(odom, Pose.planar(1.5, 2.6))) == UNKNOWN


def test_a_speed_limit_holds_where_its_zone_lies(tmp_path):
    odom = odom_at(1.5, 0.5, 0.6)
    costmap, _ = filters(tmp_path, odom)
    costmap.update(None, 0.0)
    limits = [costmap.speed_limit(*on(odom, pose), 1.0) for pose in (INSIDE, OUTSIDE, Pose.planar(3.5, 0.5))]
    assert limits == pytest.approx([0.002, 1.0, 0.0])


def test_filters_follow_their_frame_and_without_it_the_map_is_not_current(tmp_path):
    costmap, transforms = filters(tmp_path)
    costmap.update(None, 0.0)
    assert "'keepout'" in costmap.stale_reason(0.0) and (costmap.snapshot().cells == UNKNOWN).all()
    for stamp, x in ((1.0, 0.0), (2.0, 1.0)):
        odom = Transform((x, 0.5, 0.0), quaternion_from_yaw(0.6), "map", "odom", stamp)
        transforms.set(odom)
        costmap.update(None, stamp)
        assert not costmap.stale_reason(stamp)
        assert costmap.snapshot().cost_at(*on(odom, INSIDE)) == LETHAL
        assert costmap.snapshot().cost_at(*on(odom, OUTSIDE)) == UNKNOWN
