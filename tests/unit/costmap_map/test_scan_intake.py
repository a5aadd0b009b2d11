"""Scans reach every map that listens, placed where the sensor was when it measured, not where it is by now."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose, quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.geometry.transform_problems import ExtrapolationError
from mbf_abstract.maps.scan_intake import MAX_SOURCES
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock

MAP = """
  width: 8.0
  height: 8.0
  origin_x: -4.0
  origin_y: -4.0
  robot_radius: 0.2
  layers: [{name: obstacles, type: obstacle}]
  obstacles: {footprint_clearing_enabled: false, sources: {lidar: {obstacle_max_range: 9.0}}}
"""
CONFIG = f"backend: costmap\nglobal_costmap:{MAP}local_costmap:{MAP}  frame_id: drift\n"


CONNECTED = Transform((0.0, 0.0, 0.0), parent="map", child="drift", static=True)


@pytest.fixture
def site(tmp_path):
    """A server with a global map in map and a local one in drift, its transforms, and what it has reported."""
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG)
    clock, transforms, reported = SimClock(), TransformBuffer(), MemorySink()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
    events = EventBus(clock.now, [reported])
    with Navigator.from_file(file, robot, clock, transforms, events) as navigator:
        yield (
            navigator.server,
            transforms,
            lambda: [event.data["message"] for event in reported.of_kind(EventKind.FAULT)],
        )
    robot.close()


def turned(yaw, stamp, parent="drift", child="laser"):
    return Transform((0.0, 0.0, 0.0), quaternion_from_yaw(yaw), parent, child, stamp)


def ahead(stamp, frame="laser", source="lidar"):
    """Something 2 m ahead of the sensor."""
    return RangeScan(source, frame, (0.05, 0.05, 0.1), [(2.05, 0.05, 0.1)], [True], stamp)


def seen(costmap, now=1.0):
    """Directions [deg] in which the map shows something."""
    costmap.update(None, now)
    snapshot = costmap.snapshot()
    cells = [(ix, iy) for iy in range(80) for ix in range(80) if snapshot.cost(ix, iy) == 254]
    return [round(math.degrees(math.atan2(*snapshot.cell_to_world(*cell)[::-1]))) for cell in cells]


@pytest.mark.parametrize(("stamp", "direction"), [(0.0, 0.0), (0.25, 45.0), (0.5, 90.0)])
def test_a_scan_is_placed_by_the_transform_of_its_own_time(site, stamp, direction):
    server, transforms, _ = site
    for time, yaw in ((0.0, 0.0), (0.5, math.pi / 2), (1.0, math.pi)):
        transforms.set(turned(yaw, time))
    server.take_scan(ahead(stamp))
    assert seen(server.local_costmap) == [pytest.approx(direction, abs=3.0)]


def test_a_scan_a_little_newer_than_the_newest_transform_is_placed_by_that_one(site):
    server, transforms, _ = site
    transforms.set(turned(0.0, 0.0))
    transforms.set(turned(math.pi / 2, 0.5))
    server.take_scan(ahead(0.79))
    assert seen(server.local_costmap) == [pytest.approx(90.0, abs=3.0)]


@pytest.mark.parametrize("stamp", [0.81, 100.0, -0.01])
def test_a_scan_of_a_time_nobody_knows_is_refused(site, stamp):
    server, transforms, _ = site
    transforms.set(CONNECTED)
    transforms.set(turned(0.0, 0.0))
    transforms.set(turned(0.0, 0.5))
    with pytest.raises(ExtrapolationError):
        server.take_scan(ahead(stamp))
    assert seen(server.local_costmap) == []


def test_a_map_that_cannot_place_a_scan_does_not_keep_it_from_the_other_and_reports_it_once(site):
    server, transforms, reported = site
    transforms.set(turned(0.0, 0.0))
    for _ in range(3):
        server.take_scan(ahead(0.0))
    assert len(seen(server.local_costmap)) == 1 and seen(server.global_costmap) == []
    (message,) = reported()
    assert "'lidar' cannot be placed" in message and "'map'" in message
    transforms.set(CONNECTED)
    server.take_scan(ahead(0.0))
    assert len(seen(server.global_costmap)) == 1 and len(reported()) == 1


def test_a_layer_that_raises_does_not_keep_a_scan_from_the_other_map_and_is_reported_once(site, monkeypatch):
    server, transforms, reported = site
    transforms.set(turned(0.0, 0.0))
    transforms.set(CONNECTED)
    (layer,) = (one for one in server.global_costmap.layers.values() if one.source_names)
    monkeypatch.setattr(layer, "insert_scan", lambda scan: 1 / 0)
    for _ in range(3):
        server.take_scan(ahead(0.0))
    assert len(seen(server.local_costmap)) == 1
    (message,) = reported()
    assert "raised ZeroDivisionError at a scan of 'lidar'" in message


def test_a_scan_that_no_map_can_place_is_refused_with_the_reason(site):
    server, _, _ = site
    with pytest.raises(TransformError, match="'nowhere'"):
        server.take_scan(ahead(0.0, frame="nowhere"))


def test_a_source_that_no_map_knows_is_reported_once_whatever_its_frame(site):
    server, _, reported = site
    for _ in range(3):
        server.take_scan(ahead(0.0, frame="nowhere", source="lidra"))
    assert reported() == ["no layer listens to the source 'lidra'; known: ['lidar']"]


def test_the_number_of_reported_names_is_bounded(site):
    server, _, reported = site
    for number in range(300):
        server.take_scan(ahead(0.0, source=f"noise{number}"))
    assert len(reported()) == 100


@pytest.mark.parametrize("frame", ["map", "laser"])
def test_a_scan_without_a_time_is_refused(site, frame):
    server, _, _ = site
    with pytest.raises(ValueError, match="'lidar'"):
        server.take_scan(ahead(math.nan, frame=frame))


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
@settings(max_examples=30, deadline=None)
def test_a_scan_in_another_frame_has_its_origin_and_ends_where_they_were(start, end, stamp):
    transforms = TransformBuffer()
    transforms.set(turned(start, 0.0))
    transforms.set(turned(end, 1.0))
    placed = ahead(stamp).in_frame("drift", transforms)
    expected = transforms.lookup("drift", "laser", stamp)
    assert placed.frame_id == "drift" and placed.stamp == stamp
    assert placed.ends[0] == pytest.approx(expected.apply([(2.05, 0.05, 0.1)])[0])
    assert placed.origin == pytest.approx(expected.apply([(0.05, 0.05, 0.1)])[0])


def test_the_newest_scan_of_every_source_is_kept_as_a_copy_also_where_no_layer_listens(site):
    server, transforms, _ = site
    transforms.set(CONNECTED)
    for stamp in (0.9, 1.0):
        transforms.set(turned(0.0, stamp))
    first, second, other = ahead(0.9), ahead(1.0), ahead(1.0, source="camera")
    reused = RangeScan("lidar", "laser", first.origin, np.array(first.ends), first.hits, 1.0)
    for scan in (first, reused, other):
        server.take_scan(scan)
    reused.ends[:] = 0.0  # a driver that uses its buffers again
    assert server.scans.keys() == {"lidar", "camera"}
    assert server.scans["lidar"].stamp == 1.0 and server.scans["lidar"].frame_id == "laser"
    assert np.array_equal(server.scans["lidar"].ends, second.ends)


def test_neither_a_late_scan_nor_a_blind_one_nor_one_that_is_refused_replaces_a_newer_one(site):
    server, transforms, _ = site
    transforms.set(CONNECTED)
    for stamp in (0.0, 0.2):
        transforms.set(turned(0.0, stamp))
    server.take_scan(ahead(0.2))
    server.take_scan(ahead(0.1))
    with pytest.raises(TransformError):
        server.take_scan(ahead(7.0))
    server.take_scan(RangeScan("lidar", "laser", (0.05, 0.05, 0.1), [(math.nan, 0.0, 0.0)], [True], 0.2))
    assert server.scans["lidar"].stamp == 0.2 and len(server.scans["lidar"].ends) == 1


def test_a_stamp_from_the_future_does_not_keep_the_scans_of_now_out(site):
    server, transforms, _ = site
    transforms.set(CONNECTED)
    for stamp in (60.0, 0.0):
        server.take_scan(ahead(stamp, frame="drift"))
    assert server.scans["lidar"].stamp == 0.0


def test_a_scan_is_copied_once_for_all_who_look_at_it(site, monkeypatch):
    server, transforms, _ = site
    transforms.set(CONNECTED)
    (layer,) = (one for one in server.local_costmap.layers.values() if one.source_names)
    taken = []
    monkeypatch.setattr(layer, "insert_scan", taken.append)
    scan = RangeScan.of_points("lidar", [(2.0, 0.0, 0.1)], (0.0, 0.0, 0.1), 0.0, "drift")
    server.take_scan(scan)
    assert taken[0].ends is server.scans["lidar"].ends and taken[0].ends is not scan.ends


def test_sources_without_end_do_not_fill_the_memory(site):
    server, _, _ = site
    for number in range(MAX_SOURCES + 5):
        server.take_scan(ahead(1.0, frame="map", source=f"made up {number}"))
    assert len(server.scans) == MAX_SOURCES
