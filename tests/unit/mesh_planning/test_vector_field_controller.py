"""The vector-field controller: its law cycle by cycle, its faults corrected, and a closed loop on hills."""

import dataclasses
import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_mesh_nav.controllers.vector_field import VectorFieldController
from mbf_mesh_nav.planners.cvp import CVPPlanner


@pytest.fixture
def ready(make_plugin, plain):
    """Factory: a controller on a flat field with a plan from (1, 3) to (5, 3)."""

    def make(**parameters):
        mesh_map = plain()
        plan = make_plugin(CVPPlanner, mesh_map).make_plan(PlanRequest(Pose.planar(1, 3), Pose.planar(5, 3, 1.0)))
        controller = make_plugin(VectorFieldController, mesh_map, **parameters)
        assert controller.set_plan(plan.path)
        return controller

    return make


def command_at(controller, pose):
    return controller.compute_velocity_commands(ControlRequest(pose, Twist())).command


def test_it_drives_at_full_speed_along_the_field(ready):
    command = command_at(ready(max_vel_x=0.7), Pose.planar(2, 3))
    assert command.vx == pytest.approx(0.7, abs=0.02) and abs(command.wz) < 0.02


@pytest.mark.parametrize("error", [-2.0, -0.2, 0.2, 2.0])
def test_the_yaw_rate_is_proportional_and_limited_on_both_sides(ready, error):
    controller = ready(ang_vel_factor=7.0, max_vel_theta=0.5)
    command = command_at(controller, Pose.planar(2, 3, -error))
    assert command.wz == pytest.approx(math.copysign(min(0.5, abs(error) * 0.5 / math.pi * 7.0), error), abs=0.02)
    expected = 1.0 - abs(error) / controller.parameters.rotate_to_heading_min_angle
    assert command.vx == pytest.approx(max(expected, 0.0), abs=0.03)


@pytest.mark.parametrize(("x", "distance", "stops"), [(1.5, 1.0, False), (2.2, 1.0, True), (2.2, 0.0, False)])
def test_it_stops_before_what_appeared_on_its_way_since_the_plan(make_plugin, plain, paint, x, distance, stops):
    mesh_map = plain()
    plan = make_plugin(CVPPlanner, mesh_map).make_plan(PlanRequest(Pose.planar(1, 3), Pose.planar(5, 3)))
    controller = make_plugin(VectorFieldController, mesh_map, check_ahead_dist=distance)
    assert controller.set_plan(plan.path)
    paint(mesh_map, lambda places: np.where(np.abs(places[:, 0] - 3.0) < 0.3, np.inf, 0.0))
    result = controller.compute_velocity_commands(ControlRequest(Pose.planar(x, 3), Twist()))
    assert (result.outcome == ExePathOutcome.BLOCKED_PATH) == stops and result.success != stops
    assert not stops or "the robot would touch it at (2." in result.message


def test_the_speed_fades_towards_the_goal(ready):
    controller = ready(arrival_fading=1.0)
    speeds = [command_at(controller, Pose.planar(x, 3)).vx for x in (3.5, 4.4, 4.7, 4.85)]
    assert speeds == sorted(speeds, reverse=True) and speeds[-1] == pytest.approx(0.15, abs=0.03)


def test_at_the_goal_it_only_turns(ready):
    command = command_at(ready(), Pose.planar(4.95, 3))
    assert command.vx == 0.0 and command.wz > 0.3


def test_a_path_without_a_field_is_refused(ready):
    controller = ready()
    assert not controller.set_plan(Path.from_points([(1, 1, 0), (2, 1, 0)]))
    assert controller.refusal.startswith("it brings no vector field along; plans of mesh.cvp do")


def test_a_field_of_another_mesh_or_a_path_in_another_frame_is_refused(make_plugin, plain):
    request = PlanRequest(Pose.planar(1, 3), Pose.planar(5, 3))
    path = make_plugin(CVPPlanner, plain()).make_plan(request).path
    elsewhere = make_plugin(VectorFieldController, plain())
    assert not elsewhere.set_plan(path)
    assert elsewhere.refusal == "its vector field belongs to another mesh, plan again"
    mesh_map = plain()
    path = make_plugin(CVPPlanner, mesh_map).make_plan(request).path
    assert make_plugin(VectorFieldController, mesh_map).set_plan(path)
    controller = make_plugin(VectorFieldController, mesh_map)
    assert not controller.set_plan(dataclasses.replace(path, frame_id="odom"))
    assert controller.refusal == "it is in the frame 'odom', the map in 'map'"


def test_off_the_surface_is_out_of_map_and_off_the_field_is_missed_path(ready):
    controller = ready()
    far = controller.compute_velocity_commands(ControlRequest(Pose.planar(2, 3, z=1.0), Twist()))
    assert far.outcome == ExePathOutcome.OUT_OF_MAP
    beyond = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.05, 0.05), Twist()))
    assert beyond.outcome == ExePathOutcome.MISSED_PATH


def test_it_reaches_the_goal_over_hills_through_a_via_point_and_from_a_disturbance(make_plugin, hills, drive, pose_on):
    via, goal = Pose.planar(5.0, 3.0), Pose.planar(0.8, 5.0, 2.0)
    planner = make_plugin(CVPPlanner, hills, goal_dist_offset=3.0)
    plan = planner.make_plan(PlanRequest(Pose.planar(0.6, 0.5), goal, via=(via,)))
    controller = make_plugin(VectorFieldController, hills, rotate_to_heading_min_angle=0.6, max_vel_theta=1.0)
    assert controller.set_plan(plan.path)
    poses = drive(controller, hills, pose_on(hills, (0.9, 1.4, 0), (-1, 0.5, 0)), 60.0)  # 0.9 m off the start
    assert controller.is_goal_reached(poses[-1], 0.15, 0.2), poses[-1]
    assert min(np.hypot(pose.x - via.x, pose.y - via.y) for pose in poses) < 0.4
