"""Scans enter a mesh map as they enter costmaps: known sources only, placed at their stamp, one report for a fault."""

import math

import numpy as np
import pytest
import trimesh

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh

CONFIG = """
backend: mesh
mesh_map:
  mesh_file: floor.ply
  inscribed_radius: 0.2
  layers: [{name: obstacles, type: obstacle}]
  obstacles: {sources: [SOURCES], ground_tolerance: 0.05}
"""


@pytest.fixture
def make_site(tmp_path):
    """``make_site(sources)`` -> server and what it has reported."""
    trimesh.Trimesh(*heightfield_mesh(np.zeros((41, 41)), 0.1, 0.1), process=False).export(tmp_path / "floor.ply")
    robots, navigators = [], []

    def make(sources):
        (tmp_path / "mesh.yaml").write_text(CONFIG.replace("SOURCES", sources))
        clock, transforms, sink = SimClock(), TransformBuffer(), MemorySink()
        robots.append(LoopbackRobot(clock, transforms, Pose.planar(1.0, 1.0)))
        events = EventBus(clock.now, [sink])
        navigators.append(Navigator.from_file(tmp_path / "mesh.yaml", robots[-1], clock, transforms, events))
        return navigators[-1].server, lambda: [event.data["message"] for event in sink.of_kind(EventKind.FAULT)]

    yield make
    for navigator, robot in zip(navigators, robots, strict=True):
        navigator.close()
        robot.close()


def scan(source="lidar", frame="map", stamp=0.0):
    """Something at (3, 1), seen from (1, 1)."""
    return RangeScan(source, frame, np.array((1.0, 1.0, 0.3)), np.array([(3.0, 1.0, 0.3)]), np.array([True]), stamp)


def test_a_scan_of_a_known_source_marks_the_surface(make_site):
    server, reported = make_site("lidar")
    server.take_scan(scan())
    assert not server.mesh_map.snapshot().lethal.any()  # the map changes when it is updated, not under the sensor
    server.queries.update_map()
    assert server.mesh_map.snapshot().lethal.any() and reported() == []


def test_a_source_that_no_layer_listens_to_is_reported_once_and_marks_nothing(make_site):
    server, reported = make_site("lidar")
    for _ in range(3):
        server.take_scan(scan(source="lidra", frame="nowhere"))
    server.queries.update_map()
    assert reported() == ["no layer listens to the source 'lidra'; known: ['lidar']"]
    assert not server.mesh_map.snapshot().lethal.any()


def test_a_layer_without_a_list_of_sources_takes_all(make_site):
    server, reported = make_site("")
    server.take_scan(scan(source="anything"))
    server.queries.update_map()
    assert server.mesh_map.snapshot().lethal.any() and reported() == []


def test_a_scan_that_cannot_be_placed_is_refused_with_the_reason(make_site):
    server, _ = make_site("lidar")
    with pytest.raises(TransformError, match="'nowhere'"):
        server.take_scan(scan(frame="nowhere"))


@pytest.mark.parametrize("stamp", [math.nan, math.inf])
def test_a_scan_without_a_time_is_refused(make_site, stamp):
    server, _ = make_site("lidar")
    with pytest.raises(ValueError, match="must be finite"):
        server.take_scan(scan(stamp=stamp))
