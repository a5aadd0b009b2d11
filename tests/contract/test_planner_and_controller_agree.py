"""What a planner calls a path its controller accepts, on the small random worlds of ``benchmarks/agreement.py``."""

import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mbf_abstract.geometry import Path as RobotPath
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest, PlanResult, PluginKind
from mbf_costmap_nav.grid.footprint_check import FootprintCheck

pytestmark = pytest.mark.usefixtures("one_core")

SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "agreement.py"
SPEC = spec_from_file_location("agreement", SOURCE)
agreement = sys.modules["agreement"] = module_from_spec(SPEC)
sys.path.insert(0, str(SOURCE.parent))  # it imports its worlds
SPEC.loader.exec_module(agreement)
rooms = sys.modules["agreement_rooms"]
robots = sys.modules["agreement_robots"]
sys.path.remove(str(SOURCE.parent))

PURSUIT = "regulated_pure_pursuit"
PLANNED = range(8)
DRIVEN = {"costmap": [8, 16], "mesh": [1]}
REFUSED = (
    ("astar", "follow_path", 0), ("astar", "regulated_pure_pursuit", 0), ("dijkstra", "follow_path", 0),
    ("theta_star", "follow_path", 0), ("astar", "follow_path", 6), ("hybrid_astar", "follow_path", 9),
    ("hybrid_astar", "regulated_pure_pursuit", 9), ("theta_star", "follow_path", 15),
    ("straight_line", "follow_path", 20), ("theta_star", "follow_path", 20), ("astar", "follow_path", 23),
    ("dijkstra", "regulated_pure_pursuit", 325), ("astar", "regulated_pure_pursuit", 353),
    ("astar", "follow_path", 353), ("hybrid_astar", "follow_path", 387),
    ("hybrid_astar", "regulated_pure_pursuit", 387), ("theta_star", "regulated_pure_pursuit", 436),
    ("astar", "regulated_pure_pursuit", 448), ("dijkstra", "follow_path", 448), ("astar", "follow_path", 459),
    ("dijkstra", "follow_path", 613), ("dijkstra", "regulated_pure_pursuit", 613),
)  # fmt: skip
"""Drives on the costmap that were refused twice at one place."""
REFUSED_ON_MESHES = (
    ("dijkstra", "follow_path", 307), ("cvp", "follow_path", 315), ("dijkstra", "follow_path", 323),
    ("any_angle", "follow_path", 336), ("cvp", "follow_path", 375),
)  # fmt: skip
"""The same on the mesh; the first goes through a passage of one vertex, the third to a goal at the end of another."""
AT_LIMITS = (
    ("costmap", "astar", 8, True), ("costmap", "theta_star", 8, True), ("mesh", "dijkstra", 84, True),
    ("mesh", "dijkstra", 65, True), ("mesh", "dijkstra", 84, False), ("mesh", "dijkstra", 104, True),
)  # fmt: skip
"""Paths along a free end of the map, or towards a wall to a goal beside it; whether no walls stand around."""
STOOD = (
    ("costmap", "hybrid_astar", "dwa", 302), ("costmap", "theta_star", "dwa", 302),
    ("costmap", "hybrid_astar", "mppi", 302), ("costmap", "dijkstra", "mppi", 304), ("costmap", "astar", "dwa", 304),
    ("costmap", "hybrid_astar", "dwa", 304), ("costmap", "hybrid_astar", "rotation_shim", 304),
    ("costmap", "dijkstra", "dwa", 308), ("costmap", "dijkstra", "dwa", 325), ("costmap", "hybrid_astar", "mppi", 325),
    ("costmap", "theta_star", "rotation_shim", 325), ("costmap", "theta_star", "dwa", 344),
    ("costmap", "astar", "dwa", 353), ("costmap", "theta_star", "mppi", 353), ("costmap", "theta_star", "dwa", 415),
    ("costmap", "astar", "dwa", 613), ("costmap", "dijkstra", "dwa", 613),
    ("mesh", "dijkstra", "mppi", 65), ("mesh", "dijkstra", "mppi", 67), ("mesh", "any_angle", "mppi", 323),
)  # fmt: skip
"""Drives with sampled motions that stood before their goal until their time was over, crept, or touched something."""
OTHER_ROBOTS = (
    ("costmap", "dijkstra", "mppi", 2004), ("costmap", "astar", "regulated_pure_pursuit", 2007),
    ("costmap", "theta_star", "follow_path", 2008), ("costmap", "dijkstra", "follow_path", 2010),
    ("costmap", "astar", "dwa", 2010), ("costmap", "straight_line", "dwa", 2018),
    ("mesh", "cvp", "vector_field", 2007), ("mesh", "repairing", "path_follower", 2007),
    ("mesh", "heading_astar", "mppi", 2007), ("mesh", "cvp", "follow_path", 2018),
    ("mesh", "dijkstra", "mppi", 2258), ("mesh", "dijkstra", "path_follower", 2167),
    ("mesh", "cvp", "vector_field", 2157), ("mesh", "repairing", "follow_path", 2243),
    ("costmap", "straight_line", "dwa", 2183), ("costmap", "straight_line", "follow_path", 2183),
    ("costmap", "hybrid_astar", "rotation_shim", 2183), ("costmap", "dijkstra", "rotation_shim", 2257),
)  # fmt: skip
"""Robots with other outlines, inertia, rates of control and delays that touched something, or were refused."""
THROUGH_GAPS = [
    *((name, width) for name in ("dwa", "mppi", "rotation_shim", "follow_path") for width in (0.55, 0.6)),
    *(("regulated_pure_pursuit", width) for width in (0.55, 0.6)),
]
SAMPLING = (("costmap", "dwa"), ("costmap", "mppi"), ("costmap", "rotation_shim"), ("mesh", "mppi"))
FOLLOWERS = {"regulated_pure_pursuit", "follow_path", "path_follower"}
"""Controllers that keep to their path; those that sample motions may leave it."""


def every_planner():
    for backend in agreement.WORLDS:
        yield from ((backend, name) for name in agreement.installed(backend, PluginKind.PLANNER))


def driven_pairs():
    for backend, seeds in DRIVEN.items():
        chosen = [pair for pair in agreement.pairs(backend) if pair[1] in FOLLOWERS]
        yield from ((backend, *pair, seed) for pair in chosen for seed in seeds)
    yield from (("costmap", *drive) for drive in REFUSED)
    yield from (("mesh", *drive) for drive in REFUSED_ON_MESHES)


@pytest.mark.parametrize(("backend", "planner"), [pytest.param(*one, id=".".join(one)) for one in every_planner()])
def test_the_outline_fits_at_every_pose_of_a_fresh_plan(backend, planner):
    paths = 0
    for seed in PLANNED:
        world = agreement.WORLDS[backend](seed)
        if world.ends is None:
            continue
        result = world.plugin(PluginKind.PLANNER, planner).make_plan(PlanRequest(*world.ends))
        if result.success:
            paths += 1
            assert world.first_misfit(result.path) == -1, seed
    assert paths > 0


@pytest.mark.parametrize(("backend", "planner", "controller", "seed"), list(driven_pairs()))
def test_no_plan_is_refused_twice_on_a_map_that_does_not_change(backend, planner, controller, seed):
    world = agreement.WORLDS[backend](seed)
    made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, controller)
    verdict = agreement.drive(world, *made)
    assert verdict.agrees, verdict


@pytest.mark.parametrize(("backend", "planner", "seed", "is_open"), AT_LIMITS)
def test_a_plan_along_the_end_of_the_map_or_to_beside_a_wall_is_driven(backend, planner, seed, is_open):
    world = agreement.WORLDS[backend](seed, is_open)
    made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, "follow_path")
    verdict = agreement.drive(world, *made)
    assert verdict.ending == "arrived", verdict


@pytest.mark.parametrize(("backend", "planner", "controller", "seed"), STOOD)
def test_sampled_motions_arrive_where_room_is_narrow_and_touch_nothing(backend, planner, controller, seed):
    world = agreement.WORLDS[backend](seed)
    made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, controller)
    verdict = agreement.drive(world, *made)
    assert verdict.ending == "arrived", verdict


@pytest.mark.parametrize(
    ("controller", "seed"),
    [("regulated_pure_pursuit", seed) for seed in (23, 47, 57)] + [("follow_path", seed) for seed in (10, 18, 26)],
)
def test_a_robot_that_plans_anew_twice_a_second_arrives(controller, seed):
    world = agreement.WORLDS["costmap"](seed)
    made = world.plugin(PluginKind.PLANNER, "dijkstra"), world.plugin(PluginKind.CONTROLLER, controller)
    verdict = agreement.drive(world, *made, replan=2.0)
    assert verdict.ending == "arrived", verdict


@pytest.mark.parametrize(("backend", "planner", "controller", "seed"), OTHER_ROBOTS)
def test_a_robot_with_another_outline_and_inertia_arrives_and_touches_nothing(backend, planner, controller, seed):
    robot = robots.drawn_robot(seed, is_disc=backend == "mesh")
    world = agreement.WORLDS[backend](seed, False, robot)
    made = world.plugin(PluginKind.PLANNER, planner), world.plugin(PluginKind.CONTROLLER, controller)
    verdict = agreement.drive(world, *made)
    assert verdict.ending == "arrived", verdict


def test_a_plan_of_a_car_touches_nothing_between_its_poses_either():
    world = agreement.WORLDS["costmap"](2196, False, robots.drawn_robot(2196))
    planner, start = world.plugin(PluginKind.PLANNER, "hybrid_astar"), Pose.planar(1.4946021, 1.0733639, 0.3565901)
    path = planner.make_plan(PlanRequest(start, world.ends[1])).path
    poses = np.array([(pose.x, pose.y, pose.yaw) for pose in path])
    finely = [a + share * (b - a) for a, b in pairwise(poses) for share in np.linspace(0.0, 1.0, 11)]
    check = FootprintCheck(world.map.footprint, world.resolution)
    assert check.first_collision(world.map.snapshot(), np.array(finely)) == -1


class OnePlan:
    """A planner that knows one path, and only once."""

    def __init__(self, path):
        self.path = path

    def make_plan(self, request):
        path, self.path = self.path, None
        return PlanResult(ExePathOutcome.SUCCESS, "", path) if path else PlanResult(56, "a second plan is asked for")


def bend_into_a_gap(world, x, mouth):
    """Towards a gap at ``x`` [m], a right bend of 0.6 m that ends where the front is 4 cm before it, and through it."""
    radius, y = 0.6, mouth + 1.15
    before = [(x - radius - 0.05 * k, y, 0.0) for k in range(30, 0, -1)]
    turned = np.linspace(0.0, 0.5 * np.pi, 20)
    bend = [(x - radius + radius * np.sin(a), y - radius + radius * np.cos(a), -a) for a in turned.tolist()]
    behind = [(x, y - radius - 0.05 * k, -0.5 * np.pi) for k in range(1, 50)]
    return RobotPath.from_poses([world.pose_on(*map(float, pose)) for pose in before + bend + behind])


@pytest.mark.parametrize("seed", [4, 7, 11, 22, 39])  # they touched something, or drove round and round at the end
def test_a_car_arrives_in_a_tight_room(seed):
    world = agreement.WORLDS["car"](seed)
    made = world.plugin(PluginKind.PLANNER, "hybrid_astar"), world.plugin(PluginKind.CONTROLLER, PURSUIT)
    verdict = agreement.drive(world, *made)
    assert verdict.ending == "arrived", verdict


def test_a_car_that_has_passed_its_goal_with_another_heading_asks_for_a_new_plan():
    world = agreement.WORLDS["car"](4)
    world.build(rooms.walls(world.side))
    path = RobotPath.from_poses([world.pose_on(3.0 + 0.1 * k, 4.0, 0.0) for k in range(10)])
    controller = world.plugin(PluginKind.CONTROLLER, PURSUIT)
    assert controller.set_plan(path)
    for x, outcome in ((3.85, ExePathOutcome.SUCCESS), (4.05, ExePathOutcome.MISSED_GOAL)):
        pose = world.pose_on(x, 4.0, 0.5)
        assert not controller.is_goal_reached(pose, 0.1, 0.2)
        result = controller.compute_velocity_commands(ControlRequest(pose, Twist.planar(0.1)))
        assert result.outcome == outcome, result.message
    assert result.message == "the robot is 0.15 m past the end of its path, 29 degrees off its heading"


@pytest.mark.parametrize(("controller", "width"), THROUGH_GAPS)
def test_a_gap_hardly_wider_than_the_robot_is_driven_through_at_once(controller, width):
    world, left, mouth = agreement.WORLDS["costmap"](0), 2.75, 4.3
    sides = rooms.Box(0.0, left, 2.5, mouth), rooms.Box(left + width, rooms.SIDE, 2.5, mouth)
    world.build([*rooms.WALLS, *sides])
    path = bend_into_a_gap(world, left + 0.5 * width, mouth)
    world.ends = path[0], path[len(path) - 1]
    verdict = agreement.drive(world, OnePlan(path), world.plugin(PluginKind.CONTROLLER, controller))
    assert verdict.ending == "arrived", verdict


@pytest.mark.parametrize("controller", ["follow_path", PURSUIT])
def test_in_a_gap_a_stroke_is_driven_to_its_end(controller):
    world, cusp = agreement.WORLDS["costmap"](0), (3.025, 2.2)
    world.build([*rooms.WALLS, rooms.Box(0.0, 2.75, 1.0, 5.0), rooms.Box(3.3, rooms.SIDE, 1.0, 5.0)])
    ys = [*np.arange(4.2, cusp[1], -0.05), *np.arange(cusp[1], 3.5, 0.05)]
    path = RobotPath.from_poses([world.pose_on(cusp[0], float(y), -0.5 * np.pi) for y in ys])
    driver, track = world.plugin(PluginKind.CONTROLLER, controller), [path[0]]
    assert driver.set_plan(path)
    while not driver.is_goal_reached(track[-1], 0.1, 0.2):
        result = driver.compute_velocity_commands(ControlRequest(track[-1], world.motion.velocity))
        assert result.success, result.message
        track.append(world.moved(track[-1], result.command)[0])
    assert min(pose.y for pose in track) == pytest.approx(cusp[1], abs=0.0051)


def test_a_plan_through_a_gap_leaves_some_room_to_both_sides_where_there_is_any():
    world = agreement.WORLDS["costmap"](613)  # a gap of 0.55 m for a padded width of 0.52 m
    path = world.plugin(PluginKind.PLANNER, "dijkstra").make_plan(PlanRequest(*world.ends)).path
    check = FootprintCheck(world.map.footprint.offset(0.2 * world.resolution), world.resolution)
    poses = np.array([(pose.x, pose.y, pose.yaw) for pose in path])
    assert check.first_collision(world.map.snapshot(), poses) == -1


@pytest.mark.parametrize(("backend", "controller"), SAMPLING)
def test_a_robot_that_no_motion_gets_on_stands_for_a_stated_time_then_says_where(backend, controller):
    walls, wall = rooms.WALLS, rooms.Box(3.0, 3.2, 0.0, rooms.SIDE)
    world = agreement.WORLDS[backend](0)
    world.build([*walls])
    start, goal = world.pose_on(1.5, 3.0, 0.0), world.pose_on(4.5, 3.0, 0.0)
    plan = world.plugin(PluginKind.PLANNER, "dijkstra").make_plan(PlanRequest(start, goal))
    world.build([*walls, wall])  # somebody closed it since
    driver = world.plugin(PluginKind.CONTROLLER, controller)
    assert driver.set_plan(plan.path)
    track, result = [start], None
    while (result is None or result.success) and world.clock.time < 60.0:
        driver.is_goal_reached(track[-1], 0.1, 0.2)
        result = driver.compute_velocity_commands(ControlRequest(track[-1], world.motion.velocity))
        track.append(world.moved(track[-1], result.command or Twist())[0])
        assert world.fits(track[-1])
    assert result.outcome == ExePathOutcome.NO_VALID_CMD, result
    x, y = map(float, re.search(r"\((-?[0-9.]+), (-?[0-9.]+)", result.message).groups())
    assert track[-1].distance_to(Pose.planar(x, y, 0.0, track[-1].z)) < 0.1, result.message
    came = next(k for k, pose in enumerate(track) if pose.distance_to(track[-1]) < 0.1)
    # It may creep by as much as once counts as getting on, before it stands for good.
    assert (len(track) - came) * world.robot.period < 12.0
