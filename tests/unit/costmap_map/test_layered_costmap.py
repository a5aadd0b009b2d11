"""The layered costmap: update windows, the rolling window, snapshots, currency, clearing, sensors."""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, UNKNOWN, CellBox, Costmap
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap

HERE = Pose.planar(5.0, 5.0)


def lethal_cells(costmap):
    return {(int(ix), int(iy)) for iy, ix in np.argwhere(costmap.snapshot().cells == LETHAL)}


# --------------------------------------------------------------------------------------------- update windows
LAYERS = ("obstacle", "denoise", "inflation", "keepout")


def with_windows(seeing):
    """A map whose last layer comes after the inflation and so must not be inflated."""
    laser = seeing["sources"]["laser"] | {"observation_persistence": 0.0}
    parameters = CostmapParameters.model_validate(
        {
            "resolution": 1.0,
            "width": 20.0,
            "height": 15.0,
            "robot_radius": 0.0,
            "footprint_padding": 0.0,
            "layers": [{"name": name, "type": name} for name in LAYERS],
        }
    )
    blocks = {
        "obstacle": seeing | {"sources": {"laser": laser}},
        "denoise": {"minimal_group_size": 3, "group_connectivity_type": 4},
        "inflation": {"inflation_radius": 2.0, "cost_scaling_factor": 0.5},
        "keepout": {"zones": [{"name": "door", "polygon": [[15.5, 3.5], [16.5, 3.5], [16.5, 4.5]]}]},
    }
    return build_layered_costmap(parameters, blocks)


SCANS = st.lists(
    st.lists(st.tuples(st.floats(0.1, 19.9), st.floats(0.1, 14.9)), min_size=1, max_size=8), min_size=1, max_size=5
)


@given(SCANS)
@settings(max_examples=30, deadline=None)
def test_updating_changed_boxes_gives_the_same_map_as_updating_everything(scans):
    laser = {"obstacle_max_range": 50.0, "raytrace_max_range": 50.0, "expected_update_rate": 0.0}
    by_boxes, at_once = (
        with_windows({"footprint_clearing_enabled": False, "sources": {"laser": laser}}) for _ in range(2)
    )
    by_boxes.update(None, 0.0)
    for stamp, points in enumerate(scans):
        for costmap in (by_boxes, at_once):
            costmap.insert_points("laser", [(*p, 0.0) for p in points], (10.0, 7.0, 0.0), float(stamp))
        box = by_boxes.update(None, float(stamp))
        at_once.set_footprint(at_once.unpadded_footprint)  # recomputes every cell
        assert at_once.update(None, float(stamp)) == at_once.geometry.box
        assert np.array_equal(by_boxes.snapshot().cells, at_once.snapshot().cells), box


def test_only_the_box_around_a_change_is_recomputed(build, seeing):
    costmap = build("obstacle", obstacle=seeing, width=50.0, height=50.0)
    costmap.update(None, 0.0)
    costmap.insert_points("laser", [(12.5, 10.5, 0.0)], (10.5, 10.5, 0.0), 0.0)
    assert costmap.update(None, 0.1) == CellBox(10, 10, 13, 11)


def test_nothing_new_recomputes_nothing_and_keeps_the_snapshot(build):
    costmap = build("static", "inflation")
    assert costmap.update(None, 0.0) == costmap.geometry.box
    snapshot = costmap.snapshot()
    assert costmap.update(None, 1.0).empty
    assert costmap.snapshot() is snapshot


def test_a_snapshot_is_read_only_and_keeps_its_content(build, seeing):
    costmap = build("obstacle", obstacle=seeing)
    before = costmap.snapshot()
    costmap.insert_points("laser", [(5.0, 5.0, 0.0)], (0.0, 0.0, 0.0), 0.0)
    costmap.update(None, 0.0)
    assert before.cost(5, 5) == FREE and costmap.snapshot().cost(5, 5) == LETHAL
    assert costmap.snapshot().version > before.version
    with pytest.raises(ValueError, match="read-only"):
        before.cells[0, 0] = 1


# --------------------------------------------------------------------------------------------- rolling window
@pytest.fixture
def rolling(build, seeing):
    seeing["sources"]["laser"]["observation_persistence"] = 0.0
    return build("obstacle", obstacle=seeing, rolling_window=True, width=10.0, height=6.0, track_unknown_space=True)


def test_a_rolling_window_keeps_the_robot_in_its_middle(rolling):
    rolling.update(Pose.planar(103.2, -7.9), 0.0)
    snapshot = rolling.snapshot()
    assert (snapshot.origin_x, snapshot.origin_y) == (98.0, -11.0)
    assert snapshot.world_to_cell(103.2, -7.9) == (5, 3)


def test_marks_stay_where_they_are_in_the_world_while_the_window_moves(rolling):
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", [(2.5, 1.5, 0.0)], (0.0, 0.0, 0.0), 0.0)
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", [(0.5, -2.5, 0.0)], (0.5, -1.5, 0.0), 1.0)
    for step in range(1, 4):
        rolling.update(Pose.planar(float(step), 0.0), float(step))
        assert rolling.snapshot().cost_at(2.5, 1.5) == LETHAL
    assert rolling.snapshot().cost_at(7.5, 0.5) == UNKNOWN, "new ground comes in unknown"


def test_a_layer_that_raises_when_the_window_moves_begins_anew_with_the_next_update(rolling, monkeypatch):
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", [(2.5, 1.5, 0.0)], (0.0, 0.0, 0.0), 0.0)
    layer = rolling.layers["obstacle"]
    monkeypatch.setattr(layer, "shift", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        rolling.update(Pose.planar(1.0, 0.0), 1.0)
    assert "layer 'obstacle' raised ZeroDivisionError" in rolling.stale_reason(1.0)
    monkeypatch.undo()
    rolling.update(Pose.planar(1.0, 0.0), 1.5)
    assert layer.geometry == rolling.geometry and rolling.snapshot().cost_at(2.5, 1.5) == LETHAL
    assert "raised" not in rolling.stale_reason(1.5)


def test_what_leaves_the_window_is_forgotten(rolling):
    rolling.insert_points("laser", [(2.5, 1.5, 0.0)], (0.0, 0.0, 0.0), 0.0)
    rolling.update(Pose.planar(0.0, 0.0), 0.0)
    rolling.insert_points("laser", np.zeros((0, 3)), (50.0, 0.0, 0.0), 1.0)
    rolling.update(Pose.planar(50.0, 0.0), 1.0)
    rolling.update(Pose.planar(0.0, 0.0), 2.0)
    assert rolling.snapshot().cost_at(2.5, 1.5) == UNKNOWN


def test_without_a_pose_a_rolling_window_stays(rolling):
    rolling.update(Pose.planar(20.0, 0.0), 0.0)
    rolling.update(None, 1.0)
    assert rolling.snapshot().contains(20.0, 0.0)


@given(st.lists(st.tuples(st.integers(-12, 12), st.integers(-12, 12)), min_size=1, max_size=6))
@settings(max_examples=25, deadline=None)
def test_a_static_map_under_a_rolling_window_is_the_same_as_sampled_anew(moves):
    world = Costmap(np.random.default_rng(3).integers(0, 255, (20, 20)).astype(np.uint8), 1.0, -10.0, -10.0)
    parameters = CostmapParameters.model_validate(
        {"resolution": 1.0, "width": 8.0, "height": 6.0, "rolling_window": True, "track_unknown_space": True}
        | {"layers": [{"name": "walls", "type": "static"}]}
    )
    rolled = build_layered_costmap(parameters, static_map=world)
    x = y = 0
    for dx, dy in moves:
        x, y = x + dx, y + dy
        rolled.update(Pose.planar(x, y), 0.0)
        fresh = build_layered_costmap(parameters, static_map=world)
        fresh.update(Pose.planar(x, y), 0.0)
        assert np.array_equal(rolled.snapshot().cells, fresh.snapshot().cells)


def test_a_pose_in_another_frame_is_refused(build):
    with pytest.raises(ValueError, match="'odom'"):
        build("static").update(Pose.planar(0.0, 0.0, frame_id="odom"), 0.0)


# ---------------------------------------------------------------------------------------------------- currency
def test_a_map_is_not_current_before_its_first_update_nor_long_after_the_last(build):
    costmap = build("static", max_age=2.0)
    assert costmap.stale_reason(0.0) == "the costmap has not been updated yet"
    costmap.update(None, 10.0)
    assert not costmap.stale_reason(12.0)
    assert "2.50 s old" in costmap.stale_reason(12.5)


def test_a_silent_sensor_makes_the_map_not_current_by_default(build):
    costmap = build("obstacle", obstacle={"sources": {"laser": {}}})
    costmap.update(None, 0.0)
    assert "'laser' has not sent anything" in costmap.stale_reason(0.0)
    costmap.insert_points("laser", [(1.0, 1.0, 0.0)], (0.0, 0.0, 0.0), 0.0)
    costmap.update(None, 1.0)
    assert not costmap.stale_reason(1.0)
    costmap.update(None, 1.5)
    assert "layer 'obstacle': observation source 'laser' is silent for 1.50 s" in costmap.stale_reason(1.5)


@pytest.mark.parametrize("layer", ["obstacle", "voxel", "range_sensor"])
def test_a_stamp_from_the_future_is_reported_and_does_not_cover_silence(build, layer):
    costmap = build(layer, **{layer: {"sources": {"laser": {}}}})

    def see(stamp, now):
        costmap.insert_points("laser", [(3.0, 3.0, 0.3)], (1.0, 3.0, 0.3), stamp)
        costmap.update(None, now)

    see(10.1, 10.0)
    assert not costmap.stale_reason(10.0), "clocks differ a little"
    see(1e6, 10.1)
    for now in (10.1, 50.0, 1000.0):
        costmap.update(None, now)
        assert "'laser' has a stamp" in costmap.stale_reason(now)
    see(1000.0, 1000.0)
    assert not costmap.stale_reason(1000.0), "the source is right again"
    costmap.update(None, 1002.0)
    assert "'laser' is silent for 2.00 s" in costmap.stale_reason(1002.0)


@pytest.mark.parametrize("stamp", [math.nan, math.inf, -math.inf])
def test_a_stamp_that_is_no_time_is_refused(build, seeing, stamp):
    costmap = build("obstacle", obstacle=seeing)
    with pytest.raises(ValueError, match="origin and stamp of a scan must be finite"):
        costmap.insert_points("laser", [(1.0, 1.0, 0.0)], (0.0, 0.0, 0.0), stamp)


def test_an_observation_from_the_future_is_not_kept_until_its_time(build, seeing):
    costmap = build("obstacle", obstacle=seeing)
    for stamp, x in ((0.0, 1.5), (1e6, 3.5)):
        costmap.insert_points("laser", [(x, 5.5, 0.0)], (x, 4.5, 0.0), stamp)
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == {(1, 5), (3, 5)}, "the last one is used: an obstacle is never ignored"
    costmap.insert_scan(RangeScan.of_rays("laser", (0.5, 5.5, 0.0), [(9.5, 5.5, 0.0)], [False], 20.0))
    costmap.update(None, 20.0)
    assert lethal_cells(costmap) == set()


@pytest.mark.parametrize("layer", ["obstacle", "voxel", "range_sensor"])
@pytest.mark.parametrize("clear", [lambda m: m.clear(), lambda m: m.clear_area(HERE, 4)], ids=["all", "area"])
def test_a_cleared_map_is_not_current_before_it_sees_again(build, layer, clear):
    costmap = build(layer, **{layer: {"sources": {"laser": {}}}}, width=10, height=10)

    def see(now):
        costmap.insert_points("laser", [(3.0, 3.0, 0.3)], (1.0, 3.0, 0.3), now)

    see(0.0)
    costmap.update(HERE, 0.0)
    assert not costmap.stale_reason(0.0)
    clear(costmap)
    costmap.update(HERE, 0.1)
    assert "'laser' is in the map since it was cleared" in costmap.stale_reason(0.1)
    see(0.2)
    assert costmap.stale_reason(0.2)
    costmap.update(HERE, 0.2)
    assert not costmap.stale_reason(0.2)


def test_an_unknown_source_is_refused_with_the_known_ones(build, seeing):
    costmap = build("obstacle", obstacle=seeing)
    with pytest.raises(ValueError, match=r"'lidar', known are \['laser'\]"):
        costmap.insert_points("lidar", [(1.0, 1.0, 0.0)], (0.0, 0.0, 0.0), 0.0)


# ----------------------------------------------------------------------------------------------------- sensors
def test_a_scan_clears_along_misses_and_marks_only_hits(build, seeing):
    seeing["sources"]["laser"]["observation_persistence"] = 0.0
    costmap = build("obstacle", obstacle=seeing)
    costmap.insert_points("laser", [(3.5, 5.5, 0.0), (3.5, 3.5, 0.0)], (0.5, 5.5, 0.0), 0.0)
    costmap.update(None, 0.0)
    costmap.insert_scan(
        RangeScan.of_rays("laser", (0.5, 5.5, 0.0), [(9.5, 5.5, 0.0), (0.5, 8.5, 0.0)], [False, True], 1.0)
    )
    costmap.update(None, 1.0)
    assert lethal_cells(costmap) == {(3, 3), (0, 8)}


def test_rays_with_ends_that_are_not_finite_are_dropped(build, seeing):
    costmap = build("obstacle", obstacle=seeing)
    costmap.insert_scan(
        RangeScan.of_rays("laser", (0.5, 0.5, 0.0), [(np.inf, 0.0, 0.0), (np.nan, 0.0, 0.0)], [True, True], 0.0)
    )
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == set()


def test_the_ground_under_the_robot_is_freed(build, seeing):
    outline = [(1.4, 1.4), (-1.4, 1.4), (-1.4, -1.4), (1.4, -1.4)]
    seeing |= {"footprint_clearing_enabled": True}
    costmap = build("obstacle", obstacle=seeing, outline=outline)
    costmap.insert_points("laser", [(5.5, 5.5, 0.0), (8.5, 5.5, 0.0)], (9.5, 5.5, 0.0), 0.0)
    costmap.update(Pose.planar(5.5, 5.5), 0.0)
    assert lethal_cells(costmap) == {(8, 5)}


def test_what_stands_in_the_padding_of_the_robot_is_kept(build, seeing):
    """A controller that does not see it turns into it."""
    outline = [(1.4, 1.4), (-1.4, 1.4), (-1.4, -1.4), (1.4, -1.4)]
    seeing |= {"footprint_clearing_enabled": True}
    costmap = build("obstacle", obstacle=seeing, outline=outline)
    costmap.set_footprint(costmap.unpadded_footprint, padding=1.0)
    costmap.insert_points("laser", [(6.5, 5.5, 0.0), (7.5, 5.5, 0.0)], (9.5, 5.5, 0.0), 0.0)
    costmap.update(Pose.planar(5.5, 5.5), 0.0)
    assert lethal_cells(costmap) == {(7, 5)}


def test_persistent_observations_come_back_after_a_ray_cleared_them(build, seeing):
    seeing["sources"]["laser"]["observation_persistence"] = 1.0
    costmap = build("obstacle", obstacle=seeing)
    costmap.insert_points("laser", [(3.5, 5.5, 0.0)], (0.5, 5.5, 0.0), 0.0)
    costmap.insert_scan(RangeScan.of_rays("laser", (0.5, 5.5, 0.0), [(9.5, 5.5, 0.0)], [False], 0.5))
    costmap.update(None, 0.5)
    assert lethal_cells(costmap) == {(3, 5)}
    costmap.update(None, 1.2)
    assert lethal_cells(costmap) == set(), "the older one is out of use"


def test_a_voxel_column_keeps_what_a_higher_ray_passes_over(build, seeing):
    seeing["sources"]["laser"]["observation_persistence"] = 0.0
    costmap = build("voxel", voxel=seeing)
    costmap.insert_points("laser", [(5.5, 5.5, 0.1)], (0.5, 5.5, 0.1), 0.0)
    costmap.update(None, 0.0)
    costmap.insert_scan(RangeScan.of_rays("laser", (0.5, 5.5, 1.5), [(9.5, 5.5, 1.5)], [False], 1.0))
    costmap.update(None, 1.0)
    assert lethal_cells(costmap) == {(5, 5)}
    costmap.insert_scan(RangeScan.of_rays("laser", (0.5, 5.5, 0.1), [(9.5, 5.5, 0.1)], [False], 2.0))
    costmap.update(None, 2.0)
    assert lethal_cells(costmap) == set()


def test_voxels_move_with_the_window_and_are_cleared_by_area(build, seeing):
    seeing["sources"]["laser"]["observation_persistence"] = 0.0
    costmap = build("voxel", voxel=seeing, rolling_window=True)
    costmap.insert_points("laser", [(2.5, 1.5, 0.5)], (0.0, 0.0, 0.5), 0.0)
    costmap.update(Pose.planar(0.0, 0.0), 0.0)
    costmap.insert_points("laser", np.zeros((0, 3)), (2.0, 0.0, 0.5), 1.0)
    costmap.update(Pose.planar(2.0, 0.0), 1.0)
    assert costmap.snapshot().cost_at(2.5, 1.5) == LETHAL
    costmap.clear_area(Pose.planar(2.5, 1.5), 6.0, inside=True)
    costmap.update(Pose.planar(2.0, 0.0), 2.0)
    assert lethal_cells(costmap) == set()


def test_a_sonar_that_is_cleared_forgets_its_readings(build):
    block = {"sources": {"sonar": {"field_of_view": math.radians(20.0)}}}
    costmap = build("range_sensor", range_sensor=block)
    costmap.insert_scan(RangeScan.of_rays("sonar", (2.0, 5.5, 0.0), [(5.5, 5.5, 0.0)], [True], 0.0))
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == {(5, 5)} and not costmap.stale_reason(0.5) and costmap.stale_reason(1.5)
    costmap.clear()
    costmap.update(None, 0.1)
    assert lethal_cells(costmap) == set()


@pytest.mark.parametrize("layer", ["obstacle", "voxel", "range_sensor"])
def test_a_reading_on_a_large_map_costs_what_its_box_costs(build, layer):
    costmap = build(layer, **{layer: {"sources": {"eye": {}}}}, width=2000.0, height=2000.0)
    costmap.update(None, 0.0)
    costmap.insert_scan(RangeScan.of_rays("eye", (1000.5, 1000.5, 0.2), [(1002.5, 1000.5, 0.2)], [True], 0.1))
    tracemalloc.start()
    assert not costmap.update(None, 0.1).empty
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 200_000, "nothing of the size of the map is made"
    assert lethal_cells(costmap) == {(1002, 1000)}


# ---------------------------------------------------------------------------------------------------- clearing
@pytest.mark.parametrize("inside", [True, False])
def test_clearing_an_area_forgets_what_was_seen_but_not_the_floor_plan(build, seeing, inside):
    costmap = build("static", "obstacle", "inflation", obstacle=seeing)
    costmap.update(None, 0.0)
    walls = lethal_cells(costmap)
    costmap.insert_points("laser", [(1.5, 5.5, 0.0)], (0.5, 5.5, 0.0), 0.0)
    costmap.update(None, 0.0)
    assert lethal_cells(costmap) == walls | {(1, 5)}
    assert costmap.clear_area(Pose.planar(5.0 if inside else 99.0, 5.0), 30.0, inside=inside) == ["obstacle"]
    costmap.update(None, 0.1)
    assert walls and lethal_cells(costmap) == walls


def test_clearing_everything_returns_to_the_static_map(build, seeing):
    costmap = build("static", "obstacle", obstacle=seeing)
    costmap.update(None, 0.0)
    walls = lethal_cells(costmap)
    costmap.insert_points("laser", [(1.5, 5.5, 0.0)], (0.5, 5.5, 0.0), 0.0)
    costmap.update(None, 0.0)
    costmap.clear_area(Pose.planar(5.0, 5.0), 30.0, layer_names=["static", "obstacle"], inside=True)
    costmap.update(None, 0.1)
    assert lethal_cells(costmap) == set(), "a static layer that is named loses the area"
    assert costmap.clear() == ["static", "obstacle"]
    costmap.update(None, 0.2)
    assert lethal_cells(costmap) == walls


def test_clearing_an_unknown_layer_names_the_known_ones(build):
    with pytest.raises(KeyError, match="no layer 'laser', only"):
        build("static").clear(["laser"])


# ------------------------------------------------------------------------------------------- costs layer by layer
def test_costs_after_each_layer_are_those_of_the_map_with_the_layers_up_to_it():
    seeing = {"footprint_clearing_enabled": False, "sources": {"laser": {"expected_update_rate": 0.0}}}
    watched, parts = with_windows(seeing), [with_windows(seeing) for _ in LAYERS]
    for part, last in zip(parts, range(len(LAYERS)), strict=True):
        for name in LAYERS[last + 1 :]:
            part.set_layer_parameters(name, part.usual_parameters(name).model_copy(update={"enabled": False}))
    assert watched.costs_after_layers(5.0, 5.0) == {}, "they are kept from the first question on"
    for time, place in ((0.1, (6.5, 5.5)), (0.2, (4.5, 7.5))):
        for one in (watched, *parts):
            one.insert_points("laser", [(*place, 0.0)], (10.0, 7.0, 0.0), time)
            one.update(HERE, time)

    for y in np.arange(0.5, 15.0):
        for x in np.arange(0.5, 20.0):
            wanted = [int(part.snapshot().cells[int(y), int(x)]) for part in parts]
            assert watched.costs_after_layers(x, y) == dict(zip(LAYERS, wanted, strict=True))
    assert watched.costs_after_layers(25.0, 5.0) == {}
