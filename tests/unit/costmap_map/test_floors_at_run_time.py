"""Maps of the floor that come on a topic while the server runs: the grid, the costs, and what follows for goals."""

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.event_bus import EventBus
from mbf_abstract.event_sinks import MemorySink
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.maps.queries import CellState
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.server.batch_planner import BatchPlanner
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.sim_clock import SimClock
from mbf_costmap_nav.files.map_io import OccupancyMap
from mbf_costmap_nav.grid.costmap import FREE, LETHAL, UNKNOWN, GridGeometry
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.static_maps import StaticMaps

CONFIG = """
backend: costmap
planner_frequency: 0.0
planner_max_retries: 0
planners: [{name: astar, type: astar}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
recovery_behaviors: [{name: pause, type: wait}]
global_costmap:
  robot_radius: 0.2
  max_cells: 50000
  layers: [{name: walls, type: static}, {name: inflation, type: inflation}]
  walls: {map_topic: /map}
local_costmap:
  rolling_window: true
  width: 4.0
  height: 4.0
  resolution: 0.1
  robot_radius: 0.2
  layers: [{name: walls, type: static}, {name: inflation, type: inflation}]
  walls: {map_topic: /map}
"""


def floor(width=100, height=100, resolution=0.1, x=-5.0, y=-5.0, wall=None, **more):
    """A free floor; with a wall at x = 1 m where ``wall`` says so of the y of each cell."""
    occupancy = np.zeros((height, width), dtype=np.uint8)
    if wall is not None:
        ys = y + (np.arange(height) + 0.5) * resolution
        occupancy[wall(ys), round((1.0 - x) / resolution)] = 100
    return FloorMap(occupancy, resolution, x, y, **more)


@pytest.fixture
def site(tmp_path):
    """A navigator without a map and its robot at the origin, on simulated time."""
    clock, transforms, sink = SimClock(), TransformBuffer(), MemorySink()
    (tmp_path / "robot.yaml").write_text(CONFIG)
    robot = LoopbackRobot(clock, transforms, Pose.planar(0.0, 0.0))
    navigator = Navigator.from_file(tmp_path / "robot.yaml", robot, clock, transforms, EventBus(clock.now, [sink]))
    navigator.robot, navigator.seen = robot, sink
    yield navigator
    navigator.close()
    robot.close()


def come(site, new):
    """Let a map come, and the maps of the server be updated."""
    site.server.take_floor("/map", new)
    site.server.runtime.clock.sleep(0.3)


def costmap(**walls):
    """A costmap of one static layer that waits for ``/map``, and an obstacle layer."""
    layers = [{"name": "walls", "type": "static"}, {"name": "obstacles", "type": "obstacle"}]
    parameters = CostmapParameters(layers=layers, max_cells=walls.pop("max_cells", 10_000), track_unknown_space=True)
    sources = {"obstacles": {"sources": {"scan": {"observation_persistence": 0.0}}}}
    return build_layered_costmap(parameters, {"walls": {"map_topic": "/map", **walls}, **sources})


def test_goals_before_the_first_map_end_at_once_and_say_what_is_missing(site):
    missing = "layer 'walls': no map has come on /map yet"
    planned = site.get_path(Pose.planar(2.0, 0.0))
    assert (planned.outcome, planned.message) == (GetPathOutcome.MAP_ERROR, missing)
    driven = site.go_to(Pose.planar(2.0, 0.0))
    assert (driven.outcome, driven.message) == (GetPathOutcome.MAP_ERROR, missing)
    assert not site.seen.of_kind(EventKind.RECOVERY)
    assert "no map has come on /map yet" in site.server.map_problem()
    assert site.server.queries.check_pose(Pose.planar(1.0, 1.0)).state is CellState.UNKNOWN
    (answer,) = BatchPlanner(site.server, workers=1).plan_many([Pose.planar(0.0, 0.0)], [Pose.planar(2.0, 0.0)])
    assert (answer.outcome, answer.message) == (GetPathOutcome.MAP_ERROR, missing)
    come(site, floor())
    assert site.go_to(Pose.planar(2.0, 0.0)).success


@settings(max_examples=60)
@given(
    arrays(np.uint8, (3, 4), elements=st.one_of(st.integers(0, 100), st.just(255))),
    st.integers(1, 100),
    st.booleans(),
    st.booleans(),
)
def test_costs_are_those_of_the_static_layer_of_nav2(occupancy, threshold, trinary, tracks_unknown):
    flat = OccupancyMap(occupancy, 0.1).to_costmap("map", tracks_unknown, lethal_threshold=threshold, trinary=trinary)

    def interpreted(value):  # StaticLayer::interpretValue
        if value == 255:
            return UNKNOWN if tracks_unknown else FREE
        if value >= threshold:
            return LETHAL
        return FREE if trinary else value * LETHAL // threshold

    assert flat.cells.tolist() == [[interpreted(int(value)) for value in row] for row in occupancy]


def test_the_grid_of_the_costmap_becomes_that_of_the_map():
    one = costmap()
    one.update(None, 0.0)
    before = one.snapshot()
    one.take_floor("/map", floor(30, 20, 0.25, -2.0, 1.0))
    assert one.snapshot() is before  # until the next update
    one.update(None, 1.0)
    assert one.snapshot().geometry == GridGeometry(30, 20, 0.25, -2.0, 1.0)
    assert (one.snapshot().cells == FREE).all()
    assert (before.cells == UNKNOWN).all() and before.geometry != one.geometry  # a copy that planners may still have


def test_a_rotated_map_is_that_of_a_file_with_this_yaw():
    rng = np.random.default_rng(4)
    occupancy = rng.choice(np.array([0, 40, 100, 255], dtype=np.uint8), (12, 17))
    one = costmap()
    one.take_floor("/map", FloorMap(occupancy, 0.1, 1.0, 2.0, yaw=0.5))
    one.update(None, 0.0)
    expected = OccupancyMap(occupancy, 0.1, (1.0, 2.0, 0.5)).to_costmap("map")
    assert one.geometry == expected.geometry
    assert one.snapshot().cells.tolist() == expected.cells.tolist()


def test_what_sensors_have_marked_stays_where_only_values_change():
    one = costmap()
    one.take_floor("/map", floor())
    one.update(None, 0.0)
    one.insert_scan(RangeScan.of_points("scan", [[2.05, 0.05, 0.5]], (0.0, 0.0, 0.5), 0.0, "map"))
    one.update(None, 0.1)
    one.insert_scan(RangeScan.of_points("scan", [[0.05, 2.05, 0.5]], (0.0, 0.0, 0.5), 0.2, "map"))
    one.take_floor("/map", floor(wall=lambda ys: ys < 0.0))
    one.update(None, 0.2)
    seen = one.snapshot()
    assert [seen.cost_at(x, y) for x, y in ((2.05, 0.05), (0.05, 2.05), (1.05, -1.0))] == [LETHAL] * 3


def test_on_another_grid_the_newest_scan_is_marked_again_at_once():
    one = costmap()
    one.take_floor("/map", floor())
    one.insert_scan(RangeScan.of_points("scan", [[2.05, 0.05, 0.5]], (0.0, 0.0, 0.5), 0.0, "map"))
    one.update(None, 0.0)
    one.take_floor("/map", floor(90, 80, x=-4.0, y=-4.0))
    one.update(None, 0.1)
    assert (one.geometry.width, one.snapshot().cost_at(2.05, 0.05)) == (90, LETHAL)
    assert not one.stale_reason(0.1)


def test_an_update_changes_its_window_alone():
    one, whole = costmap(), floor()
    one.take_floor("/map", whole)
    one.take_floor("/map", FloorWindow(np.full((2, 3), 100, dtype=np.uint8), 10, 20))
    one.update(None, 0.0)
    expected = np.full((100, 100), FREE)
    expected[20:22, 10:13] = LETHAL
    assert one.snapshot().cells.tolist() == expected.tolist()
    assert not whole.occupancy.any()


@pytest.mark.parametrize(
    ("window", "text"),
    [
        (FloorWindow(np.zeros((1, 3), dtype=np.uint8), 98, 0), "reaches beyond its map of 100 x 100"),
        (FloorWindow(np.zeros((1, 3), dtype=np.uint8), -1, 0), "reaches beyond its map of 100 x 100"),
        (FloorWindow(np.zeros((1, 3), dtype=np.uint8), 0, 0, "odom"), "in the frame 'odom', its map in ''"),
    ],
)
def test_an_update_that_does_not_fit_its_map_is_refused(window, text):
    one = costmap()
    with pytest.raises(ValueError, match="before its map on /map"):
        one.take_floor("/map", window)
    one.take_floor("/map", floor())
    with pytest.raises(ValueError, match=text):
        one.take_floor("/map", window)


def test_a_map_that_is_too_large_is_refused_and_the_old_one_stays():
    one = costmap()
    one.take_floor("/map", floor())
    one.update(None, 0.0)
    for large, text in ((floor(101, 100), "101 x 100 cells are more than the limit of 10000"), (floor(yaw=0.5), "136")):
        with pytest.raises(ValueError, match=text):
            one.take_floor("/map", large)
    one.update(None, 0.1)
    assert one.geometry == GridGeometry(100, 100, 0.1, -5.0, -5.0) and one.stale_reason(0.1)
    with pytest.raises(ValueError, match="before its map on /map"):  # of the large one, not of the old one
        one.take_floor("/map", FloorWindow(np.full((2, 3), 100, dtype=np.uint8), 10, 20))
    one.take_floor("/map", floor())
    one.take_floor("/map", FloorWindow(np.full((2, 3), 100, dtype=np.uint8), 10, 20))


def test_while_a_layer_cannot_take_the_new_grid_the_costmap_is_stale_and_blocked_until_the_next_map():
    parameters = CostmapParameters(
        layers=[{"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"}]
    )
    one = build_layered_costmap(parameters, {"walls": {"map_topic": "/map"}})
    one.take_floor("/map", floor())
    one.update(None, 0.0)
    assert (one.snapshot().cells == FREE).all()
    one.take_floor("/map", floor(resolution=1e-4))
    for now in (0.1, 0.2):
        with pytest.raises(ValueError, match="inflation_radius is"):
            one.update(None, now)
        assert "layer 'inflation': inflation_radius is" in one.stale_reason(now)
        assert (one.snapshot().cells == LETHAL).all()
    one.take_floor("/map", floor())
    one.update(None, 0.3)
    assert one.stale_reason(0.3) == "" and (one.snapshot().cells == FREE).all()


def test_a_map_in_another_frame_is_placed_by_its_transform(tmp_path):
    transforms = TransformBuffer()
    parameters = CostmapParameters(layers=[{"name": "walls", "type": "static"}], width=4.0, height=4.0)
    one = build_layered_costmap(parameters, {"walls": {"map_topic": "/map"}}, transforms=transforms)
    one.take_floor("/map", floor(20, 20, 0.1, 0.0, 0.0, wall=lambda ys: ys < 9.0, frame_id="floor"))
    one.update(None, 0.0)
    assert "floor" in one.stale_reason(0.0)
    assert one.missing_floor().startswith("layer 'walls': the map of /map cannot be placed: no transform from")
    transforms.set(Transform((1.0, 0.0, 0.0), parent="map", child="floor", static=True))
    one.update(None, 0.1)
    assert (one.stale_reason(0.1), one.missing_floor(), one.geometry.width) == ("", "", 40)
    assert [one.snapshot().cost_at(x, 1.0) for x in (1.05, 2.05)] == [FREE, LETHAL]


def test_the_map_of_a_file_is_there_until_one_comes(tmp_path):
    (tmp_path / "file.pgm").write_bytes(b"P5 4 4 255\n" + b"\xff" * 16)
    one = build_layered_costmap(
        CostmapParameters(layers=[{"name": "walls", "type": "static"}]),
        {"walls": {"map_file": "file.pgm", "map_topic": "/map"}},
        base_folder=tmp_path,
    )
    assert (one.missing_floor(), one.geometry.width) == ("", 4)
    one.take_floor("/map", floor())
    one.update(None, 0.0)
    assert one.geometry.width == 100


def test_on_a_new_map_the_robot_that_drives_takes_another_way(site):
    come(site, floor())
    goal = site.send(MoveBaseGoal(Pose.planar(3.0, 0.0)))
    clock = site.server.runtime.clock
    clock.sleep(0.7)
    come(site, floor(wall=lambda ys: ys < 2.5))  # the gap is far to the left
    farthest = 0.0
    while not goal.done:
        clock.sleep(0.1)
        farthest = max(farthest, site.robot.pose.y)
    assert goal.result.success and farthest > 2.4
    assert len(site.seen.of_kind(EventKind.PLAN)) == 2


def test_a_new_map_without_a_way_ends_the_goal_whatever_becomes_of_failed_replanning(site):
    come(site, floor())
    goal = site.send(MoveBaseGoal(Pose.planar(3.0, 0.0), recovery_behaviors=()))
    assert site.server.runtime.parameters.replan_failed_policy == "keep"
    site.server.runtime.clock.sleep(0.7)
    come(site, floor(wall=lambda ys: ys < 9.0))
    assert goal.wait(20.0).outcome == GetPathOutcome.NO_PATH_FOUND
    assert site.robot.pose.x < 0.9


def test_on_a_map_that_cannot_be_placed_nothing_is_planned_and_a_goal_ends(site):
    come(site, floor())
    goal = site.send(MoveBaseGoal(Pose.planar(3.0, 0.0)))
    site.server.runtime.clock.sleep(0.7)
    come(site, floor(wall=lambda ys: ys < 9.0, frame_id="elsewhere"))
    ended, text = goal.wait(20.0), "the map of /map cannot be placed: no transform from"
    assert ended.outcome == GetPathOutcome.MAP_ERROR and text in ended.message
    assert site.robot.pose.x < 0.9
    come(site, floor())
    assert site.go_to(Pose.planar(3.0, 0.0)).success


def test_a_map_that_says_nothing_new_changes_nothing(site):
    come(site, floor(wall=lambda ys: ys < 2.5))
    goal = site.send(MoveBaseGoal(Pose.planar(3.0, 0.0)))
    site.server.runtime.clock.sleep(0.7)
    come(site, floor(wall=lambda ys: ys < 2.5))
    assert goal.wait(60.0).success
    assert len(site.seen.of_kind(EventKind.PLAN)) == 1


def test_a_new_map_is_reported_once_whichever_update_takes_it_up(site):
    served, now = site.server.served["global_costmap"], site.server.runtime.clock.now()
    site.server.take_floor("/map", floor())
    served.map.update(None, now)  # as another thread does while ours waits for the lock
    for _ in range(2):
        served.update()
    assert [one.data["message"] for one in site.seen.of_kind(EventKind.MAP)].count(
        "global_costmap: a new floor has come"
    ) == 1


def test_a_goal_behind_walls_of_a_topic_is_not_unreachable_for_ever(site):
    come(site, floor(wall=lambda ys: ys < 9.0))
    planned = site.get_path(Pose.planar(3.0, 0.0))
    assert planned.outcome == GetPathOutcome.NO_PATH_FOUND and not planned.permanent


def test_a_topic_that_no_layer_expects_is_refused(site):
    assert site.server.map_topics == ("/map",)
    with pytest.raises(ValueError, match="costmap server takes no floor from /other"):
        site.server.take_floor("/other", floor())
    with pytest.raises(ValueError, match="global_costmap: 300 x 300 cells are more than the limit of 50000"):
        site.server.take_floor("/map", floor(300, 300))


def test_walls_of_a_new_map_explain_what_sensors_see():
    one, static = costmap(), StaticMaps(TransformBuffer())
    static.add(lambda: one.layers["walls"].floor_plan)
    points = np.array([[1.05, 0.0, 0.5]])
    assert not static.explain(points, "map", 0.1).any()
    for wall, explained in ((None, False), (lambda ys: ys < 9.0, True), (lambda ys: ys > 1.0, False)):
        one.take_floor("/map", floor(wall=wall))
        one.update(None, 0.0)
        assert static.explain(points, "map", 0.1).tolist() == [explained]


def test_a_mesh_takes_no_floor_and_its_configuration_refuses_the_key(tmp_path):
    file = tmp_path / "mesh.yaml"
    file.write_text(
        "backend: mesh\nmesh_map: {mesh_file: floor.ply, map_topic: /map}\nplanners: [{name: d, type: dijkstra}]\n"
    )
    with pytest.raises(ConfigError, match=r"mesh.yaml:2: .*map_topic"):
        read_config(file)


@pytest.mark.parametrize(
    ("wrong", "error", "text"),
    [
        ({"resolution": 0.0}, ValueError, "FloorMap.resolution: expected 0.0001 to 1000 m, got 0.0"),
        ({"resolution": 1e-9}, ValueError, "FloorMap.resolution: expected 0.0001 to 1000 m, got 1e-09"),
        ({"resolution": math.nan}, ValueError, "FloorMap.resolution: expected 0.0001 to 1000 m, got nan"),
        ({"origin_x": math.nan}, ValueError, "FloorMap.origin_x: expected a number within 1e+09 of zero, got nan"),
        ({"origin_y": -1e200}, ValueError, "FloorMap.origin_y: expected a number within 1e+09 of zero, got -1e+200"),
        ({"yaw": math.inf}, ValueError, "FloorMap.yaw: expected a number within 1e+09 of zero, got inf"),
        ({"occupancy": np.zeros((0, 4), np.uint8)}, ValueError, "got the shape (0, 4)"),
        ({"occupancy": np.zeros(4, np.uint8)}, ValueError, "got the shape (4,)"),
        ({"occupancy": np.full((2, 2), -1, np.int8)}, TypeError, "got an array of int8"),
        ({"occupancy": [[0, 100]]}, TypeError, "got list"),
    ],
)
def test_a_floor_that_is_none_is_refused_where_it_is_made(wrong, error, text):
    with pytest.raises(error, match=re.escape(text)):
        dataclasses.replace(floor(), **wrong)


def test_what_is_no_floor_is_refused_and_the_last_one_stays(site):
    come(site, floor())
    with pytest.raises(TypeError, match="take_floor: expected a FloorMap or a FloorWindow, got NoneType"):
        site.server.take_floor("/map", None)
    assert site.get_path(site.ground_pose(2.0, 0.0)).success
