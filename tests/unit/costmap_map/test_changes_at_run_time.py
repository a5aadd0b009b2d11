"""Parameters of maps and layers at run time: the same map as if it had been configured so, or none of it."""

import numpy as np
import pytest

from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.parameters import with_changes
from mbf_abstract.server.plugin_host import ServerError
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.layers.speed_limit import SpeedLimitLayer, SpeedLimitLayerParameters

SEEN = [(2.5, 2.5, 0.1), (2.5, 2.5, 1.1), (7.5, 2.5, 0.3), (7.5, 6.5, 0.3), (8.5, 6.5, 0.3)]
ORIGIN = (5.5, 4.5, 0.5)


def looked_at(costmap, times=6):
    """The cells after the same few scans."""
    for stamp in range(times):
        if costmap.source_names:
            costmap.insert_points("laser", SEEN, ORIGIN, float(stamp))
        costmap.update(Pose.planar(5.0, 5.0), float(stamp))
    return costmap.snapshot().cells


WIDE = {"inflation_radius": 4.0, "cost_scaling_factor": 0.5}
SONAR = {"sources": {"laser": {}}}


@pytest.mark.parametrize(
    ("types", "layer", "block", "change"),
    [
        (("static", "inflation"), "inflation", {}, {"inflation_radius": 3.0, "cost_scaling_factor": 0.5}),
        (("static", "inflation"), "inflation", WIDE, {"inflation_radius": 1.0}),
        (("static", "inflation"), "inflation", WIDE, {"enabled": False}),
        (("static", "obstacle"), "static", {}, {"enabled": False}),
        (("obstacle",), "obstacle", {"combination_method": "overwrite"}, {"combination_method": "maximum"}),
        (("static", "obstacle"), "obstacle", {}, {"combination_method": "overwrite"}),
        (("voxel",), "voxel", {}, {"mark_threshold": 1}),
        (("voxel",), "voxel", {"mark_threshold": 1, "unknown_threshold": 9}, {"unknown_threshold": 3}),
        (("range_sensor",), "range_sensor", SONAR, {"mark_threshold": 0.95}),
        (("static", "denoise"), "denoise", {}, {"minimal_group_size": 4, "group_connectivity_type": 4}),
    ],
)
def test_a_changed_layer_gives_the_map_it_would_have_given_from_the_start(build, seeing, types, layer, block, change):
    base = seeing | block if layer in ("obstacle", "voxel") else block
    blocks = {"obstacle": seeing} if "obstacle" in types else {}
    settings = {"track_unknown_space": True, "width": 10.0, "height": 10.0}
    changed = build(*types, **settings, **blocks | {layer: base})
    from_the_start = build(*types, **settings, **blocks | {layer: base | change})
    before = looked_at(changed).copy()
    changed.set_layer_parameters(layer, with_changes(changed.layers[layer].parameters, change))
    changed.update(Pose.planar(5.0, 5.0), 5.0)
    assert np.array_equal(changed.snapshot().cells, looked_at(from_the_start))
    assert layer == "obstacle" or not np.array_equal(changed.snapshot().cells, before)


def test_parameters_a_layer_does_not_take_leave_the_old_ones(build):
    costmap = build("static", "inflation", inflation={"inflation_radius": 0.02}, rolling_window=True, resolution=0.01)
    old = costmap.layers["inflation"].parameters
    before = looked_at(costmap, 1)
    with pytest.raises(ValueError, match="10000 cells"):
        costmap.set_layer_parameters("inflation", with_changes(old, {"inflation_radius": 100.0}))
    assert costmap.layers["inflation"].parameters is old
    assert np.array_equal(looked_at(costmap, 1), before)


def test_a_speed_limit_changes_at_once(build):
    zone = {"name": "hall", "polygon": [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0]], "speed_limit": 40.0}
    costmap = build("speed_limit", speed_limit={"zones": [zone], "limit_type": "percent"})
    old = costmap.layers["speed_limit"].parameters
    assert isinstance(costmap.layers["speed_limit"], SpeedLimitLayer) and isinstance(old, SpeedLimitLayerParameters)
    assert costmap.speed_limit(2.5, 1.5, 2.0) == pytest.approx(0.8)
    costmap.set_layer_parameters("speed_limit", with_changes(old, {"limit_type": "absolute"}))
    assert costmap.speed_limit(2.5, 1.5, 2.0) == 2.0


CONFIG = """
backend: costmap
global_costmap: &map
  width: 8.0
  height: 8.0
  origin_x: -4.0
  origin_y: -4.0
  robot_radius: 0.2
  layers: [{name: zone, type: keepout}, {name: around, type: inflation}]
  zone: {zones: [{name: box, polygon: [[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]]}]}
  around: {inflation_radius: 0.5}
local_costmap: *map
"""


@pytest.fixture
def site(tmp_path):
    """A server on simulated time, and what it has reported."""
    (tmp_path / "robot.yaml").write_text(CONFIG)
    clock, transforms, reported = SimClock(), TransformBuffer(), MemorySink()
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
    with Navigator.from_file(
        tmp_path / "robot.yaml", robot, clock, transforms, EventBus(clock.now, [reported])
    ) as made:
        clock.sleep(0.5)
        yield made.server, clock, reported
    robot.close()


def forbidden(costmap):
    return int(np.count_nonzero(costmap.snapshot().cells >= 253))


def test_a_layer_of_one_map_changes_with_its_next_update_and_the_log_reports(site):
    server, clock, reported = site
    costs = [np.count_nonzero(costmap.snapshot().cells) for costmap in (server.global_costmap, server.local_costmap)]
    server.set_layer_parameters("global_costmap.around", inflation_radius=1.5, cost_scaling_factor=1.0)
    clock.sleep(0.5)
    assert np.count_nonzero(server.global_costmap.snapshot().cells) > costs[0]
    assert np.count_nonzero(server.local_costmap.snapshot().cells) == costs[1]
    (event,) = reported.of_kind(EventKind.PARAMETER_CHANGED)
    assert event.source == "global_costmap.around"
    assert event.data == {"inflation_radius": 1.5, "cost_scaling_factor": 1.0}


@pytest.mark.parametrize(
    "outline",
    ["[[0.4, 0.4], [0.4, -0.4], [-0.4, -0.4], [-0.4, 0.4]]", 0.4, [(0.4, 0.4), (0.4, -0.4), (-0.4, -0.4), (-0.4, 0.4)]],
)
def test_a_robot_that_lifts_a_load_is_larger_on_both_maps(site, outline):
    server, clock, reported = site
    before = forbidden(server.global_costmap)
    server.set_footprint(outline)
    clock.sleep(0.5)
    for costmap in (server.global_costmap, server.local_costmap):
        assert costmap.inscribed_radius == pytest.approx(0.4, abs=0.02)
        assert forbidden(costmap) > before
    assert [event.source for event in reported.of_kind(EventKind.PARAMETER_CHANGED)] == [
        "global_costmap",
        "local_costmap",
    ]


def test_padding_and_age_of_one_map_change(site):
    server, _, _ = site
    server.set_map_parameters("local_costmap", footprint_padding=0.1, max_age=0.0)
    assert server.local_costmap.inscribed_radius > server.global_costmap.inscribed_radius
    assert not server.local_costmap.stale_reason(1e6) and server.global_costmap.stale_reason(1e6)


def test_a_robot_too_large_for_the_inflation_is_reported(site):
    server, _, reported = site
    server.set_footprint(0.7)
    notes = reported.of_kind(EventKind.MAP)
    assert [note.source for note in notes] == ["global_costmap", "local_costmap"]
    assert "smaller than the inscribed radius" in notes[0].data["message"]


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        (
            lambda s: s.set_layer_parameters("global_costmap.around", inflation_radius=-1),
            ValueError,
            "inflation_radius",
        ),
        (lambda s: s.set_layer_parameters("global_costmap.around", radius=1.0), ValueError, "radius"),
        (lambda s: s.set_layer_parameters("global_costmap.around", inflation_radius=90.0), ValueError, "900 cells"),
        (lambda s: s.set_layer_parameters("global_costmap.zone", mask_file="a"), ValueError, "mask_file: read once"),
        (lambda s: s.set_layer_parameters("round", enabled=False), ServerError, "no layer 'round'; known.*'?around"),
        (lambda s: s.set_layer_parameters("around", enabled=False), ServerError, "several maps have a layer 'around'"),
        (lambda s: s.set_map_parameters("global_costmap", resolution=0.2), ValueError, "resolution: read once"),
        (lambda s: s.set_map_parameters("global_costmap", robot_radius=-0.2), ValueError, "robot_radius"),
        (lambda s: s.set_footprint([(0.0, 0.0), (1.0, 0.0)]), ValueError, "at least 3 points"),
        (lambda s: s.set_footprint(float("nan")), ValueError, "finite"),
    ],
)
def test_a_change_that_is_not_legal_changes_nothing(site, change, error, text):
    server, clock, reported = site
    before = forbidden(server.global_costmap), forbidden(server.local_costmap)
    with pytest.raises(error, match=text):
        change(server)
    clock.sleep(0.5)
    assert (forbidden(server.global_costmap), forbidden(server.local_costmap)) == before
    assert not reported.of_kind(EventKind.PARAMETER_CHANGED)
