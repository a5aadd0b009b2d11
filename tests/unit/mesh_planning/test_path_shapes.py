"""All mesh controllers on paths of awkward shape: out and back, loops, ends near the start, and 24 headings."""

import math
from itertools import pairwise

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.controllers.path_follower import PathFollower
from mbf_mesh_nav.controllers.vector_field import VectorFieldController
from mbf_mesh_nav.planners.cvp import CVPPlanner

FOLLOWERS = {"follower": (PathFollower, {}), "mppi": (MPPIController, {"batch_size": 200})}


def out_and_back(spacing):
    line = np.linspace(1.5, 4.5, max(2, round(3.0 / spacing) + 1))
    return Path.from_points([(x, 3.0, 0.0) for x in [*line, *line[-2::-1]]])


def circles():
    angles = np.linspace(0.0, 4.0 * np.pi, 140)
    return Path.from_points(np.column_stack([3.0 + 1.5 * np.sin(angles), 3.0 - 1.5 * np.cos(angles), 0.0 * angles]))


def with_cusps():
    """Poses that ask for reverse in the middle; a controller that only drives forward turns round there."""
    line = [*np.linspace(1.5, 4.0, 26), *np.linspace(3.9, 2.5, 15), *np.linspace(2.6, 4.5, 20)]
    return Path.from_poses([Pose.planar(x, 3.0) for x in line])


SHAPES = {
    "out and back, three poses": out_and_back(3.0),
    "out and back, dense": out_and_back(0.05),
    "a circle twice": circles(),
    "cusps": with_cusps(),
}


@pytest.fixture
def drive_car(pose_on):
    """Drive a kinematic car of wheelbase 0.5 m; returns poses, speeds and steering angles."""

    def run(controller, pose, seconds, period=0.05):
        poses, speeds, angles, speed = [pose], [], [], 0.0
        while len(poses) < seconds / period and not controller.is_goal_reached(poses[-1], 0.25, 0.4):
            result = controller.compute_velocity_commands(ControlRequest(poses[-1], Twist.planar(vx=speed)))
            assert result.success, f"{result.outcome} {result.message} after {len(poses)} cycles"
            command = result.command
            speed = min(max(command.speed, speed - 0.1), speed + 0.1)
            turn = speed * math.tan(command.steering_angle) / 0.5 * period
            x_axis, y_axis, _ = poses[-1].rotation.T
            turned = math.cos(turn) * x_axis + math.sin(turn) * y_axis
            ahead = np.asarray(poses[-1].position) + speed * period * (x_axis + turned) / 2
            poses.append(pose_on(controller.mesh_map, ahead, turned))
            speeds.append(command.speed)
            angles.append(command.steering_angle)
        return poses, speeds, angles

    return run


def driven(poses):
    return sum(a.distance_to(b) for a, b in pairwise(poses))


@pytest.mark.parametrize("path", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("name", FOLLOWERS)
def test_the_whole_path_is_driven_in_order(make_plugin, plain, drive, name, path):
    controller_class, parameters = FOLLOWERS[name]
    controller = make_plugin(controller_class, plain(), **parameters)
    assert controller.set_plan(path)
    poses = drive(controller, plain(), path[0], 80.0, angle_tolerance=0.4)
    assert controller.is_goal_reached(poses[-1], 0.1, 0.4), poses[-1]
    assert driven(poses) > 0.75 * path.length  # a sampling controller cuts bends


@pytest.mark.parametrize("degrees", range(0, 360, 15))
@pytest.mark.parametrize("name", FOLLOWERS)
def test_a_robot_started_at_any_heading_comes_to_the_end(make_plugin, plain, drive, name, degrees):
    controller_class, parameters = FOLLOWERS[name]
    controller = make_plugin(controller_class, plain(), **parameters)
    controller.set_plan(Path.from_points([(x, 3.0, 0.0) for x in np.linspace(1.5, 4.0, 26)]))
    poses = drive(controller, plain(), Pose.planar(1.5, 3.0, math.radians(degrees)), 40.0, angle_tolerance=0.4)
    assert controller.is_goal_reached(poses[-1], 0.1, 0.4), poses[-1]


@pytest.mark.parametrize("degrees", range(0, 360, 15))
def test_a_robot_started_at_any_heading_follows_the_field_over_its_via_point_and_back(
    make_plugin, plain, drive, degrees
):
    start, via = Pose.planar(1.5, 3.0, math.radians(degrees)), Pose.planar(4.0, 3.0)
    goal = Pose.planar(1.5, 3.0, math.pi)
    mesh_map = plain()
    plan = make_plugin(CVPPlanner, mesh_map).make_plan(PlanRequest(start, goal, via=(via,)))
    controller = make_plugin(VectorFieldController, mesh_map)
    assert controller.set_plan(plan.path)
    poses = drive(controller, mesh_map, start, 60.0, angle_tolerance=0.4)
    assert controller.is_goal_reached(poses[-1], 0.1, 0.4), poses[-1]
    assert driven(poses) > 4.0


def test_a_car_that_may_not_reverse_refuses_a_path_whose_poses_ask_for_it(make_plugin, plain):
    controller = make_plugin(MPPIController, plain(), motion_model="ackermann", wheelbase=0.5)
    assert not controller.set_plan(with_cusps())
    assert controller.set_plan(circles())


def turn_in_three_points(radius=1.0, step=0.05):
    """Forward to the left, back to the right, forward to the left, and at last straight back into a place."""
    pieces = ((1, 0.0, 1.0), (1, 1.0, 1.2), (-1, -1.0, 1.2), (1, 1.0, 1.2), (1, 0.0, 0.8), (-1, 0.0, 1.2))
    x, y, yaw = 2.5, 3.0, 0.0
    poses = [(x, y, yaw)]
    for sign, side, length in pieces:
        for _ in range(round(length / step)):
            turn = sign * step * side / radius
            x, y = x + sign * step * math.cos(yaw + turn / 2.0), y + sign * step * math.sin(yaw + turn / 2.0)
            yaw += turn
            poses.append((x, y, yaw))
    return Path.from_poses([Pose.planar(*pose) for pose in poses])


@pytest.mark.parametrize("path", [turn_in_three_points(), with_cusps()], ids=["three points", "straight"])
def test_a_car_drives_cusps_forward_and_back_and_keeps_to_the_robots_curves(make_plugin, plain, drive_car, path):
    controller = make_plugin(MPPIController, plain(8.0, 6.0), motion_model="ackermann", wheelbase=0.5, min_vel_x=-0.5)
    controller.min_turning_radius = 0.95
    assert controller.set_plan(path)
    poses, speeds, angles = drive_car(controller, path[0], 60.0)
    assert controller.is_goal_reached(poses[-1], 0.25, 0.4), poses[-1]
    assert driven(poses) > 0.75 * path.length
    assert min(speeds) < -0.2 and max(speeds) > 0.2
    assert max(np.abs(np.tan(angles))) <= 0.5 / 0.95 * (1.0 + 1e-9)
