"""All controllers on paths of awkward shape: cusps, loops, out and back, and starts at 24 headings."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import PlanRequest
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import MPPIController
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.controllers.rotation_shim import RotationShimController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.planners.hybrid_astar import HybridAStarPlanner

FREE_MAP = Costmap(np.zeros((160, 160), dtype=np.uint8), 0.05, -4.0, -4.0)
CAR_RADIUS = 0.9
MPPI_CAR = {"motion_model": "ackermann", "min_turning_radius": CAR_RADIUS, "batch_size": 1000}
PURSUIT_CAR = {"rotate_to_heading": False, "min_turning_radius": CAR_RADIUS}
ON_THE_SPOT = {
    "pursuit": (RegulatedPurePursuitController, {}),
    "mppi": (MPPIController, {"batch_size": 500}),
    "dwa": (DWAController, {}),
    "shim": (RotationShimController, {"inner_type": "mppi", "inner": {"batch_size": 500}}),
}
CARS = {"pursuit": (RegulatedPurePursuitController, PURSUIT_CAR), "mppi": (MPPIController, MPPI_CAR)}


def out_and_back(spacing):
    line = np.linspace(-1.5, 1.5, max(2, round(3.0 / spacing) + 1))
    return Path.from_points([(x, 0.0, 0.0) for x in [*line, *line[-2::-1]]])


def circles():
    angles = np.linspace(0.0, 4.0 * np.pi, 140)
    return Path.from_points(1.2 * np.column_stack([np.sin(angles), -np.cos(angles), 0.0 * angles]))


def figure_of_eight():
    t = np.linspace(0.0, 2.0 * np.pi, 160)
    return Path.from_points(np.column_stack([3.3 * np.sin(t), 0.9 * np.sin(2.0 * t), 0.0 * t]))


def turn_in_three_points(radius=1.0, step=0.05):
    """Forward to the left, back to the right, forward to the left, and at last straight back into a place."""
    pieces = ((1, 0.0, 1.0), (1, 1.0, 1.2), (-1, -1.0, 1.2), (1, 1.0, 1.2), (1, 0.0, 0.8), (-1, 0.0, 1.2))
    x, y, yaw = -1.5, 0.0, 0.0
    poses = [(x, y, yaw)]
    for sign, side, length in pieces:
        for _ in range(round(length / step)):
            turn = sign * step * side / radius
            x, y = x + sign * step * math.cos(yaw + turn / 2.0), y + sign * step * math.sin(yaw + turn / 2.0)
            yaw += turn
            poses.append((x, y, yaw))
    return Path.from_poses([Pose.planar(*pose) for pose in poses])


SHAPES = {
    "out and back, three poses": out_and_back(3.0),
    "out and back, dense": out_and_back(0.05),
    "a circle twice": circles(),
    "a figure of eight": figure_of_eight(),
    "a turn in three points": turn_in_three_points(),
}


def share_along(path, robot, reach=0.45, soon=160):
    """Share of points on the path that the robot came near to, in their order, each soon after the one before."""
    trace, here, seen = np.array(robot.trace)[:, :2], 0, 0
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path.positions[:, :2], axis=0).T))])
    wanted = np.arange(0.0, lengths[-1], 0.1)
    for point in np.column_stack([np.interp(wanted, lengths, path.positions[:, axis]) for axis in (0, 1)]):
        near = np.flatnonzero(np.hypot(*(trace[here : here + soon] - point).T) < reach)
        if near.size:
            here, seen = here + int(near[0]), seen + 1
    return seen / len(wanted)


def backward_share(robot):
    steps = np.diff(np.array(robot.trace), axis=0)
    yaw = np.array(robot.trace)[:-1, 2]
    ahead = steps[:, 0] * np.cos(yaw) + steps[:, 1] * np.sin(yaw)
    return float(-ahead[ahead < 0.0].sum() / np.abs(ahead).sum())


@pytest.mark.parametrize("path", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("name", ON_THE_SPOT)
def test_a_robot_that_turns_on_the_spot_drives_the_whole_path_in_order(make_plugin, closed_loop, name, path):
    controller_class, parameters = ON_THE_SPOT[name]
    controller, start = make_plugin(controller_class, FREE_MAP, **parameters), path[0]
    robot, outcome, _ = closed_loop.follow(
        controller, path, FREE_MAP, start=(start.x, start.y, start.yaw), seconds=80.0, angle_tolerance=0.4
    )
    assert outcome == 0, f"{outcome} at {robot.state}"
    assert share_along(path, robot) > 0.95


@pytest.mark.parametrize("shape", ["a turn in three points", "a circle twice", "a figure of eight"])
@pytest.mark.parametrize("name", CARS)
def test_a_car_drives_the_whole_path_and_never_turns_tighter_than_it_can(make_plugin, closed_loop, name, shape):
    controller_class, parameters = CARS[name]
    path = SHAPES[shape]
    controller, start = make_plugin(controller_class, FREE_MAP, **parameters), path[0]
    robot, outcome, _ = closed_loop.follow(
        controller,
        path,
        FREE_MAP,
        start=(start.x, start.y, start.yaw),
        seconds=80.0,
        dist_tolerance=0.25,
        angle_tolerance=0.4,
    )
    assert outcome == 0, f"{outcome} at {robot.state}"
    assert share_along(path, robot) > 0.95
    for command in robot.commands:
        assert abs(command.wz) * CAR_RADIUS <= abs(command.vx) * (1.0 + 1e-6) + 1e-9


@pytest.mark.parametrize("degrees", range(0, 360, 15))
@pytest.mark.parametrize("name", ON_THE_SPOT)
def test_a_robot_started_at_any_heading_turns_and_drives_forward(make_plugin, closed_loop, name, degrees):
    controller_class, parameters = ON_THE_SPOT[name]
    controller = make_plugin(controller_class, FREE_MAP, **parameters)
    path = Path.from_points([(x, 0.0, 0.0) for x in np.linspace(-1.5, 1.5, 31)])
    start = (-1.5, 0.0, math.radians(degrees))
    robot, outcome, _ = closed_loop.follow(controller, path, FREE_MAP, start=start, seconds=30.0, angle_tolerance=0.4)
    assert outcome == 0, f"{outcome} at {robot.state}"
    assert backward_share(robot) < 0.1


HYBRID_GOALS = [(-1.2, 0.19, -2.68), (-0.3, 1.46, 0.59), (-0.2, 1.02, 0.71), (0.86, -1.96, -2.53)]


@pytest.mark.parametrize("goal", HYBRID_GOALS)
def test_a_car_comes_to_the_end_of_a_hybrid_plan_with_its_heading_at_once(make_plugin, closed_loop, goal):
    planner = make_plugin(HybridAStarPlanner, FREE_MAP, min_turning_radius=1.3)
    path = planner.make_plan(PlanRequest(Pose.planar(0.0, 0.0), Pose.planar(*goal))).path
    controller = make_plugin(MPPIController, FREE_MAP, **{**MPPI_CAR, "min_turning_radius": 1.06, "max_vel_theta": 1.0})
    robot, outcome, seconds = closed_loop.follow(
        controller, path, FREE_MAP, start=(0.0, 0.0, 0.0), seconds=60.0, dist_tolerance=0.25, angle_tolerance=0.3
    )
    assert outcome == 0, f"{outcome} at {robot.state}"
    assert seconds < 4.0 + path.length / 0.25


def test_a_car_that_stands_beside_its_goal_asks_for_another_plan(make_plugin, closed_loop):
    controller = make_plugin(MPPIController, FREE_MAP, **MPPI_CAR)
    path = Path.from_points([(x, 0.0, 0.0) for x in np.linspace(-0.6, 0.0, 7)])
    _, outcome, seconds = closed_loop.follow(controller, path, FREE_MAP, start=(0.0, 0.35, 0.0), seconds=30.0)
    assert outcome == ExePathOutcome.NO_VALID_CMD and seconds < 15.0


def test_plugins_keep_to_the_curve_of_their_robot_where_no_parameter_differs(make_plugin):
    for plugin_class, parameters in (
        (HybridAStarPlanner, {}),
        (MPPIController, {"motion_model": "ackermann"}),
        (RegulatedPurePursuitController, {}),
    ):
        plugin = make_plugin(plugin_class, FREE_MAP, turning_radius=1.2, **parameters)
        assert plugin.turning_radius == 1.2
        own = make_plugin(plugin_class, FREE_MAP, turning_radius=1.2, min_turning_radius=2.0, **parameters)
        assert own.turning_radius == 2.0
    assert make_plugin(MPPIController, FREE_MAP, motion_model="ackermann").turning_radius == 0.5
    assert make_plugin(MPPIController, FREE_MAP, turning_radius=1.2).turns_on_the_spot


def test_pure_pursuit_never_turns_a_car_on_the_spot(make_plugin, closed_loop):
    controller = make_plugin(RegulatedPurePursuitController, FREE_MAP, turning_radius=CAR_RADIUS)
    path = Path.from_points([(x, 0.0, 0.0) for x in np.linspace(-1.5, 2.0, 31)])
    robot, _, _ = closed_loop.follow(controller, path, FREE_MAP, start=(-1.5, 0.0, 1.2), seconds=20.0)
    for command in robot.commands:
        assert abs(command.wz) * CAR_RADIUS <= abs(command.vx) * (1.0 + 1e-6) + 1e-9
