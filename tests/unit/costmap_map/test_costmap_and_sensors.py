"""What a layered costmap makes of its sensors: fresh or stale, marked and cleared, along rays and in columns."""

import math
import tracemalloc

import numpy as np
import pytest

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from mbf_costmap_nav.grid.costmap import LETHAL
from tests.unit.costmap_map.conftest import lethal_cells

HERE = Pose.planar(5.0, 5.0)


# ---------------------------------------------------------------------------------------------------- freshness
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
    assert "nothing of observation source 'laser' is in the map" in costmap.stale_reason(0.0)
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
        assert "'laser' is stamped" in costmap.stale_reason(now)
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
    with pytest.raises(ValueError, match=r"'lidar'; known: \['laser'\]"):
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
    for stamp in (0.1, 0.2):  # kernels are compiled in the first update
        costmap.insert_scan(RangeScan.of_rays("eye", (1000.5, 1000.5, 0.2), [(1002.5, 1000.5, 0.2)], [True], stamp))
        tracemalloc.start()
        assert not costmap.update(None, stamp).empty
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert peak < 200_000, "nothing of the size of the map is made"
    assert lethal_cells(costmap) == {(1002, 1000)}
