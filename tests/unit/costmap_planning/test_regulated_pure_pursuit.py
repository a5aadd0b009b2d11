"""Regulated pure pursuit: Nav2's numbers, its failures, and closed loops in a room."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.layers.static import StaticLayer
from mbf_costmap_nav.map.costmap_config import CostmapParameters, build_layered_costmap
from mbf_costmap_nav.map.layer import LayerContext
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.planners.astar import AStarPlanner

SQUARE = Footprint([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
FREE_MAP = Costmap(np.zeros((200, 200), dtype=np.uint8), 0.05, -5.0, -5.0)


@pytest.fixture
def pursuit(make_plugin):
    return lambda costmap=FREE_MAP, **parameters: make_plugin(RegulatedPurePursuitController, costmap, **parameters)


def straight(length=3.0, backward=False):
    xs = np.linspace(0.0, -length if backward else length, 31)
    return Path(np.column_stack([xs, 0 * xs, 0 * xs]))


def first_command(controller, path, pose=None, velocity=None):
    assert controller.set_plan(path)
    request = ControlRequest(pose or Pose.planar(0, 0), velocity or Twist())
    return controller.compute_velocity_commands(request)


def test_f098_fixed_look_ahead(pursuit):
    assert pursuit(use_velocity_scaled_look_ahead=False).look_ahead_distance(10.0) == 0.6


@pytest.mark.parametrize(("speed", "distance"), [(10.0, 0.9), (0.35, 0.525), (0.0, 0.3)], ids=lambda v: f"F098-{v}")
def test_velocity_scaled_look_ahead(pursuit, speed, distance):
    assert pursuit().look_ahead_distance(speed) == pytest.approx(distance)


@pytest.mark.parametrize(("carrot", "turns"), [((0.5, 0.25), False), ((0.5, 1.0), True)], ids=["F099-no", "F099-yes"])
def test_turn_to_path(pursuit, carrot, turns):
    path = Path.from_points([(0, 0, 0), (10 * carrot[0], 10 * carrot[1], 0)])
    assert (first_command(pursuit(), path).command.vx == 0.0) == turns


def test_f100_turn_to_goal_heading_stays_on_once_it_was_inside(pursuit):
    controller = pursuit()
    path = Path.from_points([(0, 0, 0), (1, 0, 0)], final_orientation=Pose.planar(0, 0, 1.0).orientation)
    controller.set_plan(path)

    def speed_at(x):
        controller.is_goal_reached(Pose.planar(x, 0), 0.25, 0.1)
        return controller.compute_velocity_commands(ControlRequest(Pose.planar(x, 0), Twist())).command.vx

    assert speed_at(0.74) > 0.0
    assert speed_at(0.76) == 0.0
    assert speed_at(0.74) == 0.0


@pytest.mark.parametrize(
    ("angle", "speed", "expected"),
    [
        pytest.param(0.4, 1.75, 1.6, id="F101-braking"),
        pytest.param(0.4, 0.0, 0.16, id="F101-from-rest"),
        pytest.param(0.4, 1.0, 1.16, id="F101-running"),
        pytest.param(-0.4, -1.75, -1.6, id="F102-braking"),
        pytest.param(-0.4, 1.0, 0.84, id="F102-turning-back"),
    ],
)
def test_turning_in_place(pursuit, angle, speed, expected):
    assert pursuit().rotation_speed(angle, speed) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("curvature", "remaining", "speed"),
    [(0.7407, 10.0, 0.5), (1000.0, 10.0, 0.25), (0.0, 0.0, 0.05)],
    ids=["F103-open", "F103-tight", "F103-finished"],
)
def test_regulated_speed(pursuit, curvature, remaining, speed):
    assert pursuit().regulated_speed(curvature, 0, remaining) == pytest.approx(speed)


def test_speed_drops_near_obstacles(pursuit):
    controller = pursuit(regulated_min_speed=0.0)
    speeds = [controller.regulated_speed(0.0, cost, 10.0) for cost in (0, 1, 100, 252)]
    assert speeds[0] == 0.5 and speeds == sorted(speeds, reverse=True) and speeds[-1] < 0.2


def test_f106_obstacle_beyond_the_end_of_the_path_is_ignored(pursuit):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[90:110, 115:118] = 254  # 0.75 m ahead, the footprint reaches 0.2 m
    costmap = Costmap(cells, 0.05, -5.0, -5.0)
    assert first_command(pursuit(costmap, check_ahead_time=5.0), straight(0.15), velocity=Twist.planar(0.5)).success


def test_obstacle_on_the_path_is_blocked_path_and_says_where(pursuit):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[90:110, 108:111] = 254
    result = first_command(pursuit(Costmap(cells, 0.05, -5.0, -5.0)), straight(), velocity=Twist.planar(0.5))
    assert result.outcome == ExePathOutcome.BLOCKED_PATH
    assert "touch it at (0." in result.message


@pytest.mark.parametrize(("shortest", "gap"), [(0.0, 0.0), (0.3, 0.3)], ids=["by-time", "by-distance"])
def test_a_robot_that_may_creep_does_so_up_to_the_distance_it_has_to_keep(pursuit, shortest, gap):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:, 140:] = 254  # a wall at x = 2
    controller = pursuit(Costmap(cells, 0.05, -5.0, -5.0), min_distance_to_obstacle=shortest)
    controller.set_plan(straight())
    x, speed = 0.0, 0.0
    for _ in range(600):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(x, 0), Twist.planar(speed)))
        speed = result.command.vx if result.success else 0.0
        x += 0.05 * speed
    nose = x + 0.2
    assert 2.0 - gap - 0.2 < nose <= 2.0 - gap + 0.05


def test_footprint_on_an_obstacle_is_a_collision(pursuit):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[100, 103] = 254
    result = first_command(pursuit(Costmap(cells, 0.05, -5.0, -5.0)), straight())
    assert result.outcome == ExePathOutcome.COLLISION


def test_the_collision_check_may_have_a_padding_of_its_own(make_plugin):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:92, :] = cells[109:, :] = 254  # a corridor 0.85 m wide for a robot of 0.4 m with 0.25 m of padding
    corridor = Costmap(cells, 0.05, -5.0, -5.0)
    walls = StaticLayer(LayerContext("walls", StaticLayer.Parameters(), static_map=corridor))
    padded = LayeredCostmap(corridor.geometry, [walls], SQUARE, footprint_padding=0.25)
    padded.update(None, 0.0)

    def outcome(**parameters):
        controller = make_plugin(RegulatedPurePursuitController, corridor, costmap=padded, **parameters)
        return first_command(controller, straight()).outcome

    assert outcome() == ExePathOutcome.COLLISION
    assert outcome(collision_check_padding=0.1) == ExePathOutcome.SUCCESS
    assert outcome(collision_check_padding=0.3) == ExePathOutcome.COLLISION


def test_far_from_the_path_it_is_missed(pursuit):
    result = first_command(pursuit(), straight(), pose=Pose.planar(0, 2.0))
    assert result.outcome == ExePathOutcome.MISSED_PATH and "2.00 m from the path" in result.message


def test_robot_off_the_map_is_out_of_map(pursuit):
    assert first_command(pursuit(), straight(), pose=Pose.planar(9, 0)).outcome == ExePathOutcome.OUT_OF_MAP


def test_a_path_in_another_frame_or_without_poses_is_refused(pursuit):
    # F129: Nav2 answers that the robot is infinitely far from a path without poses.
    controller = pursuit()
    assert not controller.set_plan(Path.from_points([(0, 0, 0)], frame_id="odom"))
    assert controller.refusal == "no transform leads from its frame 'odom' to 'map'"
    assert not controller.set_plan(Path(np.zeros((0, 3))))
    assert controller.refusal == "it has no poses"


def test_poses_against_the_path_are_driven_backward(pursuit):
    result = first_command(pursuit(), straight(backward=True))
    assert result.command.vx < 0.0 and abs(result.command.wz) < 1e-6


@pytest.mark.parametrize(
    ("pose", "reached"),
    [
        pytest.param((3.0, 0.0, 0.0), True, id="F086"),
        pytest.param((2.0, 0.0, 0.0), False, id="F087-x"),
        pytest.param((3.0, 1.0, 0.0), False, id="F087-y"),
        pytest.param((3.0, 0.0, 1.0), False, id="F087-yaw"),
        pytest.param((2.75, 0.0, 0.0), True, id="F090-limit"),
        pytest.param((2.75 - 1e-9, 0.0, 0.0), False, id="F091-beyond"),
    ],
)
def test_goal_tolerances(pursuit, pose, reached):
    controller = pursuit()
    controller.set_plan(straight())
    controller.is_goal_reached(Pose.planar(1.5, 0.0), 0.25, 0.25)
    assert controller.is_goal_reached(Pose.planar(*pose), 0.25, 0.25) == reached


def test_f088_headings_are_wrapped(pursuit):
    controller = pursuit()
    controller.set_plan(Path.from_poses([Pose.planar(0, 0, 3.14)]))
    assert controller.is_goal_reached(Pose.planar(0, 0, -3.14), 0.25, 0.25)


def test_f092_a_path_that_comes_back_later_is_not_finished_at_its_start(pursuit):
    loop = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 0)]
    controller = pursuit()
    controller.set_plan(Path.from_points(loop))
    assert not controller.is_goal_reached(Pose.planar(0, 0, -math.pi / 2), 0.25, 0.25)


def test_it_drives_through_the_room_without_touching_anything(pursuit, make_plugin, room, closed_loop):
    plan = make_plugin(AStarPlanner, room).make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(7, 1, math.pi / 2)))
    robot, outcome, _ = closed_loop.follow(pursuit(room), plan.path, room, start=(1, 1, 0))
    assert outcome == 0
    vertices = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    assert not any(closed_loop.lethal_under(room, vertices, state) for state in robot.trace[::5])


def test_it_drives_a_path_with_a_change_of_direction(pursuit, closed_loop):
    xs = np.concatenate([np.linspace(0, 2, 21), np.linspace(1.9, -1, 30)])
    path = Path(np.column_stack([xs, np.zeros_like(xs), np.zeros_like(xs)]))
    robot, outcome, _ = closed_loop.follow(pursuit(), path, FREE_MAP, start=(0, 0, 0))
    assert outcome == 0
    assert max(state[0] for state in robot.trace) > 1.7 and abs(robot.state[2]) < 0.2


def inflated_map(**inflation):
    """10 m x 10 m with one inflation layer."""
    layers = ({"name": "walls", "type": "static"}, {"name": "inflation", "type": "inflation"})
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:, 150] = 254
    parameters = CostmapParameters(resolution=0.05, robot_radius=0.2, max_age=0.0, layers=layers)
    costmap = build_layered_costmap(parameters, {"inflation": inflation}, static_map=Costmap(cells, 0.05))
    costmap.update(None, 0.0)
    return costmap


def test_the_decay_of_costs_is_that_of_the_inflation_layer_unless_it_is_given(make_plugin):
    costmap = inflated_map(cost_scaling_factor=6.0)
    controller = make_plugin(RegulatedPurePursuitController, FREE_MAP, costmap=costmap)
    assert controller.decay == 6.0
    layer = costmap.layers["inflation"]
    costmap.set_layer_parameters("inflation", layer.parameters.model_copy(update={"cost_scaling_factor": 3.0}))
    assert controller.decay == 3.0
    given = {"inflation_cost_scaling_factor": 8.0}
    assert make_plugin(RegulatedPurePursuitController, FREE_MAP, costmap=costmap, **given).decay == 8.0
    assert make_plugin(RegulatedPurePursuitController, FREE_MAP).decay == 10.0


@pytest.mark.parametrize("factor", [2.0, 6.0])
def test_the_slow_down_near_a_wall_is_by_the_distance_to_it_whatever_the_inflation_decays_by(make_plugin, factor):
    costmap = inflated_map(cost_scaling_factor=factor, inflation_radius=1.0)
    controller = make_plugin(RegulatedPurePursuitController, FREE_MAP, costmap=costmap, regulated_min_speed=0.0)
    cost = costmap.snapshot().cost_at(7.5 - 0.375, 5.0)  # eight cells from the wall
    assert controller.regulated_speed(0.0, cost, 10.0) == pytest.approx(0.5 * 0.4 / 0.6, rel=0.03)


def test_a_map_whose_costs_do_not_decay_slows_nothing_down(make_plugin):
    controller = make_plugin(RegulatedPurePursuitController, FREE_MAP, costmap=inflated_map(cost_scaling_factor=0.0))
    assert controller.regulated_speed(0.0, 200, 10.0) == 0.5
