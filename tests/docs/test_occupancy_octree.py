"""The octree backend of the guide: a robot learns its map from scans, drives around a post and under a table."""

import importlib

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.graph.graph_planner import GraphPlanner
from mbf_abstract.maps.map_plugin import MapContext
from mbf_abstract.maps.queries import CellState, PlaceQuery
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.navigator import Navigator
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RecoveryOutcome
from mbf_abstract.testing.contract import check_planner
from mbf_abstract.testing.loopback import LoopbackRobot
from mbf_abstract.time.clock import Priority
from mbf_abstract.time.sim_clock import SimClock

CONFIG = """\
backend: occupancy_octree:OctreeServer
planner_max_retries: 0
dist_tolerance: 0.2
controller_patience: 2.0
planner_frequency: 1.0
planners:
  - {name: dijkstra, type: "mbf_abstract.maps.graph.graph_planner:GraphPlanner"}
controllers:
  - {name: follower, type: follow_path}
recovery_behaviors: [{name: ahead, type: drive_on_heading}, {name: clear, type: clear}]
ahead: {distance: 5.0, speed: 0.4}
occupancy_octree:
  resolution: 0.2
  width: 16.0
  height: 16.0
  origin_x: -6.0
  origin_y: -8.0
  robot_radius: 0.3
  obstacles: {sources: [lidar], expected_update_rate: 1.5}
"""
START, GOAL = Pose.planar(0.05, 0.05), Pose.planar(6.05, 0.05)
POST = np.array([[2.5, -0.8, 0.0], [2.8, 0.8, 2.0]])  # lower and upper corner
TABLE = np.array([[4.0, -3.0, 1.2], [5.0, 3.0, 1.3]])
RANGE = 4.0


def octree(name="octree"):
    return importlib.import_module(name)


def see(origin, boxes=(POST, TABLE)):
    """Cast rays of a 3D lidar at boxes: ends (n, 3) and hits (n,)."""
    yaw, pitch = (a.ravel() for a in np.meshgrid(np.linspace(-3.1, 3.1, 72), np.linspace(-0.3, 0.3, 6)))
    rays = np.column_stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    nearest = np.full(len(rays), RANGE)
    for lower, upper in boxes:
        entries, exits = np.sort([(lower - origin) / rays, (upper - origin) / rays], axis=0)
        enters, leaves = entries.max(axis=1), exits.min(axis=1)
        nearest = np.where((enters < leaves) & (enters > 0.0), np.minimum(nearest, enters), nearest)
    return origin + rays * nearest[:, None], nearest < RANGE


class World:
    """A robot with a lidar 0.8 m above the ground that scans every second while ``on``."""

    def __init__(self, folder):
        file = folder / "navigation.yaml"
        file.write_text(CONFIG)
        self.clock, transforms = SimClock(), TransformBuffer()
        self.robot = LoopbackRobot(self.clock, transforms, START)
        self.navigator = Navigator.from_file(file, self.robot, self.clock, transforms)
        self.on = self.alive = True
        self.track = []
        self.clock.spawn(self._scan, "lidar", Priority.SIMULATOR)
        self.clock.sleep(0.9)

    def _scan(self):
        while self.alive:
            self.track.append(self.robot.pose.position[:2])
            if self.on:
                origin = np.array([self.robot.pose.x, self.robot.pose.y, 0.8])
                ends, hits = see(origin)
                self.navigator.server.take_scan(RangeScan("lidar", "map", origin, ends, hits, self.clock.now()))
            self.clock.sleep(1.0)

    def close(self):
        self.alive = False
        self.navigator.close()
        self.robot.close()
        self.clock.sleep(1.0)


@pytest.fixture
def world(tmp_path):
    made = World(tmp_path)
    yield made
    made.close()


def test_the_robot_drives_around_the_post_and_under_the_table(world):
    result = world.navigator.go_to(GOAL)

    track = np.array(world.track)
    beside_the_post = track[(track[:, 0] > 2.4) & (track[:, 0] < 2.9)]
    assert result.success, result.message
    assert world.robot.pose.distance_to(GOAL) < 0.3
    assert np.abs(beside_the_post[:, 1]).min() > 0.8 + 0.25, "the post is 0.8 m wide to either side"
    assert np.abs(track[track[:, 0] > 4.0, 1]).max() < 3.0, "the table is straight ahead"


def test_the_recoveries_of_the_core_stop_before_the_post_and_while_nothing_is_seen(world):
    ahead = world.navigator.recover("ahead")
    assert ahead.outcome == RecoveryOutcome.IMPASSABLE and "an obstacle is in the way" in ahead.message
    assert 1.5 < world.robot.pose.x < 2.5 - 0.3 + 0.1
    assert world.navigator.recover("clear").message == "cleared obstacles"
    assert not world.navigator.server.navigation_map.state.lethal.any()
    world.on = False
    world.clock.sleep(2.0)
    stale = world.navigator.recover("ahead")
    assert stale.outcome == RecoveryOutcome.PAT_EXCEEDED and "'lidar' is silent" in stale.message


def test_a_plan_keeps_away_from_what_was_seen_and_goes_under_the_table(world):
    plan = world.navigator.get_path(GOAL)
    queries = world.navigator.server.queries
    at_the_table = plan.path.positions[(plan.path.positions[:, 0] > 4.0) & (plan.path.positions[:, 0] < 5.0)]

    assert plan.success and plan.cost == pytest.approx(plan.path.length, rel=0.05)
    assert plan.path.length > 6.3, "the straight line is 6 m and goes through the post"
    assert np.abs(at_the_table[:, 1]).max() < 3.0
    assert queries.check_path(plan.path).state in (CellState.FREE, CellState.UNKNOWN)
    assert (
        queries.check_path(Path.from_points([(t, 0.0, 0.0) for t in np.arange(0, 2.7, 0.1)])).state is CellState.LETHAL
    )


def test_a_goal_at_the_post_is_blocked_and_one_beyond_the_extent_is_out_of_the_map(world):
    near = world.navigator.get_path(Pose.planar(2.3, 0.0), dist_tolerance=0.0)
    far = world.navigator.get_path(Pose.planar(45.0, 0.0))

    assert (near.outcome, far.outcome) == (GetPathOutcome.BLOCKED_GOAL, GetPathOutcome.OUT_OF_MAP)


def test_places_are_lethal_too_near_free_or_never_seen(world):
    queries = world.navigator.server.queries
    states = [queries.check_point(Pose.planar(x, 0.0)).state for x in (2.55, 2.25, 1.0, -5.5, -20.0)]

    assert states == [CellState.LETHAL, CellState.INSCRIBED, CellState.FREE, CellState.UNKNOWN, CellState.OUTSIDE]


def test_a_valid_pose_is_found_within_the_tolerance_only(world):
    queries = world.navigator.server.queries
    found = queries.find_valid_pose(Pose.planar(2.3, 0.0), 1.0, 0.0, PlaceQuery(safety_dist=0.1))

    assert found.state is CellState.INSCRIBED and 0.2 < found.pose.distance_to(Pose.planar(2.3, 0.0)) <= 1.0
    assert queries.find_valid_pose(Pose.planar(2.3, 0.0), 0.05, 0.0).pose is None


def test_without_scans_the_robot_is_held_and_the_goal_ends_with_the_reason(world):
    world.on = False
    world.clock.sleep(2.0)
    result = world.navigator.exe_path(Path.from_points([START.position, (0.0, 2.0, 0.0)]))

    assert result.outcome == ExePathOutcome.MAP_ERROR
    assert "'lidar' is silent" in result.message


def test_a_cleared_map_knows_nothing(world):
    world.on = False
    world.clock.sleep(0.3)
    world.navigator.server.queries.clear_map()

    assert world.navigator.server.queries.check_point(Pose.planar(2.55, 0.0)).state is CellState.UNKNOWN


def test_the_octree_knows_what_a_plain_table_of_cubes_knows():
    module, generator = octree(), np.random.default_rng(5)
    tree, table = module.Octree(0.1), {}
    for cube in map(tuple, generator.integers(-4, 4, (4000, 3)).tolist()):
        change = float(generator.choice([module.HIT, module.MISS]))
        tree.update(cube, change)
        table[cube] = min(max(table.get(cube, 0.0) + change, module.LOWEST), module.HIGHEST)

    for cube, value in table.items():
        assert tree.log_odds(cube) == value
    assert tree.log_odds((40, 0, 0)) is None
    heights = {(x, y) for (x, y, z), value in table.items() if value > 0.0 and 0 <= z <= 2}
    assert tree.columns(0.05, 0.25, occupied=True) == heights


def test_eight_equal_cubes_become_one_and_break_again():
    module = octree()
    tree = module.Octree(0.1)
    for _ in range(10):
        for x, y, z in np.ndindex(4, 4, 4):
            tree.update((x, y, z), module.MISS)

    assert [len(cubes) for cubes in tree.levels[:4]] == [0, 0, 1, 0]
    tree.update((1, 2, 3), module.HIT)
    assert [len(cubes) for cubes in tree.levels[:4]] == [8, 7, 0, 0]


@pytest.mark.parametrize("inside", [True, False])
def test_a_square_is_forgotten_also_where_it_cuts_large_cubes(inside):
    tree = octree().Octree(0.1)
    cubes = list(np.ndindex(8, 8, 4))
    for cube in 10 * cubes:
        tree.update(cube, octree().MISS)
    assert not tree.levels[0]

    tree.forget((0.3, 0.4), 0.2, inside)

    in_square = {cube for cube in cubes if 1 <= cube[0] < 5 and 2 <= cube[1] < 6}
    assert {cube for cube in cubes if tree.log_odds(cube) is None} == (in_square if inside else {*cubes} - in_square)


def test_what_a_ray_goes_through_is_cleared_and_its_end_is_marked():
    tree = octree().Octree(0.1)
    tree.insert(
        np.array([0.05, 0.05, 0.05]), np.array([[1.05, 0.05, 0.05], [0.05, 0.55, 0.05]]), np.array([True, False])
    )

    assert tree.log_odds((10, 0, 0)) > 0.0
    assert all(tree.log_odds((x, 0, 0)) < 0.0 for x in range(10))
    assert tree.log_odds((0, 4, 0)) < 0.0 and tree.log_odds((11, 0, 0)) is None


def test_the_planner_keeps_the_contract():
    parameters = octree("occupancy_octree").OctreeParameters(
        resolution=0.2, width=16.0, height=16.0, origin_x=-6.0, origin_y=-8.0, obstacles={"sources": ("lidar",)}
    )
    known = octree("occupancy_octree").OctreeMap(parameters, "map")
    origin = np.array([0.05, 0.05, 0.8])
    known.insert_scan(RangeScan("lidar", "map", origin, *see(origin), 0.0))
    known.update(None, 0.0)
    before = known.state

    check_planner(
        GraphPlanner,
        [(START, GOAL)],
        unreachable=[(START, Pose.planar(2.3, 0.0)), (START, Pose.planar(45.0, 0.0))],
        make_context=lambda base: MapContext(**vars(base), navigation_map=known),
        cancel_within=1.0,
    )
    assert known.state is before
