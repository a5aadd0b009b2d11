"""DWA and MPPI: single commands, and closed loops in a room."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import AckermannCommand, Path, Pose, Twist
from mbf_abstract.maps.tracking.objects import Motion, TrackedObject
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_costmap_nav.controllers.dwa import DWAController
from mbf_costmap_nav.controllers.mppi import IDLE_CYCLES, MPPIController
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.planners.theta_star import ThetaStarPlanner

CONTROLLERS = [DWAController, MPPIController]
CAR = {"motion_model": "ackermann"}
FREE_MAP = Costmap(np.zeros((200, 200), dtype=np.uint8), 0.05, -5.0, -5.0)


def straight(length=3.0):
    return Path.from_points([(x, 0.0, 0.0) for x in np.linspace(0.0, length, 31)])


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_a_straight_path_is_driven_forward(make_plugin, controller_class):
    controller = make_plugin(controller_class, FREE_MAP)
    controller.set_plan(straight())
    for _ in range(5):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.2)))
    assert result.command.vx > 0.2 and abs(result.command.wz) < 0.3


@pytest.mark.parametrize(("controller_class", "model"), [(DWAController, {}), (MPPIController, CAR)])
def test_a_robot_that_lets_somebody_by_is_not_stuck_and_names_them(make_plugin, controller_class, model):
    controller = make_plugin(controller_class, FREE_MAP, min_vel_x=0.0, **model)
    comes = TrackedObject(4, Motion.MOVING, 0.9, 0.0, 0.0, -0.4, 0.0, 0.25, 5.0, 0.0, 0.0, 0.0, "map")
    controller.navigation_map.tracked_objects = lambda now: (comes,)
    controller.set_plan(straight())
    for _ in range(IDLE_CYCLES + 20):
        result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist()))
        assert result.success and abs(result.command.vx) < 0.05
    assert result.hindered_by == "object 4 moves in the way, at (0.90, 0.00)"
    controller.navigation_map.tracked_objects = lambda now: ()
    assert controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist())).hindered_by == ""


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_a_robot_walled_in_has_no_valid_command_and_stands(make_plugin, controller_class):
    cells = np.full((200, 200), 253, dtype=np.uint8)
    controller = make_plugin(controller_class, Costmap(cells, 0.05, -5.0, -5.0))
    controller.set_plan(straight())
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist()))
    assert result.outcome == ExePathOutcome.NO_VALID_CMD and result.command is None


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_the_same_seed_gives_the_same_commands(make_plugin, room, controller_class):
    def commands():
        controller = make_plugin(controller_class, room, seed=7)
        controller.set_plan(Path.from_points([(x, 1.0, 0.0) for x in np.linspace(1, 3, 21)]))
        request = ControlRequest(Pose.planar(1.0, 1.1, 0.3), Twist.planar(0.2))
        return [controller.compute_velocity_commands(request).command for _ in range(3)]

    assert commands() == commands()


@pytest.mark.parametrize("controller_class", CONTROLLERS)
def test_it_drives_through_the_room_without_touching_anything(make_plugin, room, closed_loop, controller_class):
    planner = make_plugin(ThetaStarPlanner, room, cost_factor=10.0)
    plan = planner.make_plan(PlanRequest(Pose.planar(1, 1), Pose.planar(7, 1, math.pi / 2)))
    controller = make_plugin(controller_class, room)
    robot, outcome, _ = closed_loop.follow(controller, plan.path, room, start=(1, 1, 0), angle_tolerance=0.4)
    assert outcome == 0
    vertices = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    assert not any(closed_loop.lethal_under(room, vertices, state) for state in robot.trace[::5])


def test_mppi_drives_around_an_obstacle_that_is_on_the_path(make_plugin, closed_loop):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[97:104, 128:134] = 254
    costmap = Costmap(closed_loop.inflated(cells, 0.05, decay=4.0), 0.05, -5.0, -5.0)
    robot, outcome, _ = closed_loop.follow(make_plugin(MPPIController, costmap), straight(), costmap, start=(0, 0, 0))
    assert outcome == 0 and max(abs(state[1]) for state in robot.trace) > 0.3


def test_an_ackermann_robot_gets_steering_angles_within_its_turning_circle(make_plugin):
    controller = make_plugin(
        MPPIController, FREE_MAP, motion_model="ackermann", wheelbase=0.4, min_turning_radius=0.8, batch_size=500
    )
    controller.set_plan(Path.from_points([(0, y, 0.0) for y in np.linspace(0, 3, 31)]))
    for _ in range(5):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.3))).command
    assert isinstance(command, AckermannCommand)
    assert 0.0 < command.steering_angle <= math.atan(0.4 / 0.8) + 1e-3


def test_mppi_reports_the_sequence_it_means_to_drive_next_and_dwa_reports_none(make_plugin):
    controller = make_plugin(MPPIController, FREE_MAP, batch_size=500)
    controller.set_plan(straight())
    for _ in range(20):
        controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist.planar(0.3)))

    motion = controller.planned_motion()

    assert motion.velocities.shape == (controller.parameters.time_steps, 3)
    forward, sideways, turn = motion.velocities.sum(axis=0) * motion.step_time
    assert forward > 0.3 and sideways == 0.0 and abs(turn) < 0.2
    assert make_plugin(DWAController, FREE_MAP).planned_motion() is None


def test_an_omnidirectional_robot_drives_sideways(make_plugin):
    weights = {"twirling": 20.0, "path_angle": 0.0}
    controller = make_plugin(MPPIController, FREE_MAP, motion_model="omni", batch_size=1000, critics=weights)
    controller.set_plan(Path.from_points([(0, y, 0.0) for y in np.linspace(0, 3, 31)]))
    for _ in range(10):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist())).command
    assert command.vy > 0.05


BEND = Path.from_points(
    [*[(x, 0.0, 0.0) for x in np.linspace(0, 2, 21)], *[(2.0, y, 0.0) for y in np.linspace(0.1, 2, 20)]]
)


def test_an_ackermann_robot_drives_a_bend_without_ever_turning_tighter_than_it_can(make_plugin, closed_loop):
    radius = 0.6
    controller = make_plugin(
        MPPIController, FREE_MAP, motion_model="ackermann", min_turning_radius=radius, batch_size=500
    )
    robot, outcome, _ = closed_loop.follow(
        controller, BEND, FREE_MAP, start=(0, 0, 0), dist_tolerance=0.25, angle_tolerance=math.pi
    )
    assert outcome == 0
    steps = np.diff(np.array(robot.trace), axis=0)
    driven, turned = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    assert (turned <= driven / radius + 2e-3).all()


def test_an_omnidirectional_robot_drives_a_bend_without_turning(make_plugin, closed_loop):
    weights = {"twirling": 20.0, "path_angle": 0.0, "prefer_forward": 0.0}
    controller = make_plugin(MPPIController, FREE_MAP, motion_model="omni", batch_size=500, critics=weights)
    robot, outcome, _ = closed_loop.follow(
        controller, BEND, FREE_MAP, start=(0, 0, 0), dist_tolerance=0.2, angle_tolerance=math.pi
    )
    assert outcome == 0
    assert max(abs(state[2]) for state in robot.trace) < 0.4


@pytest.mark.parametrize("gap", [12, 9], ids=["wide", "it keeps to its path"])
def test_both_directions_of_an_omnidirectional_robot_change_together(make_plugin, gap):
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:, 112:114] = 254
    cells[96 : 96 + gap, 112:114] = 0
    model = {
        "motion_model": "omni",
        "batch_size": 500,
        "acc_lim_x": 2.0,
        "acc_lim_y": 1.0,
        "vx_std": 0.6,
        "vy_std": 0.6,
    }
    for measured in (Twist.planar(0.2, 0.4), Twist.planar(0.0, -0.3, 0.5), Twist.planar(0.5)):
        controller = make_plugin(MPPIController, Costmap(cells, 0.05, -5.0, -5.0), **model)
        controller.set_plan(Path.from_points([(x, 0.02, 0.0) for x in np.linspace(0.0, 2.0, 21)]))
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.0, 0.02), measured)).command
        gains = (command.vx - measured.vx) / (2.0 * 0.05), (command.vy - measured.vy) / (1.0 * 0.05)
        assert math.hypot(*gains) <= 1.0 + 1e-5
        assert controller._keeping.is_keeping == (gap == 9)


def test_a_robot_that_keeps_to_its_path_is_not_asked_for_ever_faster_turns_that_it_does_not_follow(make_plugin):
    """A truck of 3 m turns half as fast as commanded; asked for more and more it turned past its goal's heading."""
    cells = np.zeros((200, 200), dtype=np.uint8)
    cells[:, 112:114] = 254
    cells[96:105, 112:114] = 0
    controller = make_plugin(MPPIController, Costmap(cells, 0.05, -5.0, -5.0), batch_size=500, acc_lim_theta=1.0)
    controller.set_plan(Path.from_points([(x, 0.02, 0.0) for x in np.linspace(0.0, 2.0, 21)]))
    measured, commanded = Twist(), []
    for _ in range(20):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.0, 0.02, 0.6), measured)).command
        assert controller._keeping.is_keeping and abs(command.wz) <= abs(measured.wz) + 1.0 * 0.05 + 1e-5
        measured = Twist.planar(command.vx, wz=0.5 * command.wz)
        commanded.append(command.wz)
    assert min(commanded) < -0.05


def test_a_differential_robot_never_moves_sideways(make_plugin):
    controller = make_plugin(MPPIController, FREE_MAP, batch_size=500)
    controller.set_plan(Path.from_points([(0, y, 0.0) for y in np.linspace(0, 3, 31)]))
    for _ in range(5):
        command = controller.compute_velocity_commands(ControlRequest(Pose.planar(0, 0), Twist())).command
        assert command.vy == 0.0


@pytest.mark.parametrize("radius", [1.0, 2.0])
@pytest.mark.parametrize("off", [math.pi / 4, math.pi / 2], ids=["45 degrees", "90 degrees"])
def test_a_car_that_looks_away_from_its_path_turns_onto_it(make_plugin, closed_loop, radius, off):
    controller = make_plugin(
        MPPIController, FREE_MAP, motion_model="ackermann", min_turning_radius=radius, batch_size=1000
    )
    path = Path.from_points([(x, 0.0, 0.0) for x in np.linspace(-3.0, 3.0, 121)])
    robot, outcome, _ = closed_loop.follow(
        controller, path, FREE_MAP, start=(-3.0, 0.0, off), seconds=35.0, dist_tolerance=0.2, angle_tolerance=0.3
    )
    assert outcome == 0, f"ended at {robot.state}"


@pytest.mark.parametrize(
    ("controller_class", "parameters"),
    [(MPPIController, {"motion_model": "omni", "batch_size": 500}), (DWAController, {"max_vel_y": 0.5})],
    ids=["mppi", "dwa"],
)
def test_an_omnidirectional_robot_keeps_the_speed_limit_on_a_slant_too(
    make_plugin, closed_loop, monkeypatch, controller_class, parameters
):
    controller = make_plugin(controller_class, FREE_MAP, **parameters)
    monkeypatch.setattr(controller.costmap, "speed_limit", lambda x, y, full: min(full, 0.3))
    path = Path.from_points([(x, x, 0.0) for x in np.linspace(0, 3, 61)], Pose.planar(0, 0, 0).orientation)
    controller.set_plan(path)
    robot, speeds = closed_loop.robot(0.0, 0.0, 0.0), []
    for _ in range(60):
        command = controller.compute_velocity_commands(ControlRequest(robot.pose(), robot.velocity())).command
        speeds.append(math.hypot(command.vx, command.vy))
        robot.drive(command)
    assert 0.25 < max(speeds) <= 0.3 + 1e-6
