"""All mesh controllers on paths of awkward shape: out and back, loops, ends near the start, and 24 headings."""

import math
from itertools import pairwise

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose
from mbf_abstract.plugins import PlanRequest
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.controllers.path_follower import PathFollower
from mbf_mesh_nav.controllers.vector_field import VectorFieldController
from mbf_mesh_nav.planners.cvp import CVPPlanner

FOLLOWERS = {"follower": (PathFollower, {}), "mppi": (MPPIController, {"samples": 200})}


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


def test_a_car_refuses_a_path_whose_poses_ask_for_reverse(make_plugin, plain):
    controller = make_plugin(MPPIController, plain(), motion_model="ackermann")
    assert not controller.set_plan(with_cusps())
    assert controller.set_plan(circles())
