"""Pure pursuit on the surface: the law cycle by cycle, and closed loops on hills with a robot that turns too slowly."""

import itertools
import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_to
from mbf_abstract.maps.relaxation import Slack
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PlanRequest
from mbf_mesh_nav.controllers.mppi import MPPIController
from mbf_mesh_nav.controllers.path_follower import PathFollower
from mbf_mesh_nav.planners.astar import AStarPlanner


def line(x_from, x_to, y=3.0, count=30):
    return Path.from_points([(x, y, 0.0) for x in np.linspace(x_from, x_to, count)])


def line_through(*corners):
    """A path over corners (x, y) [m], with a pose every few centimetres."""
    steps = np.linspace(0.0, 1.0, 30)[:, None]
    points = np.concatenate([np.array(a) + steps * np.subtract(b, a) for a, b in itertools.pairwise(corners)])
    return Path.from_points(np.column_stack([points, np.zeros(len(points))]))


def command_at(follower, pose):
    return follower.compute_velocity_commands(ControlRequest(pose, Twist()))


def test_on_a_straight_line_it_drives_straight_at_full_speed(make_plugin, plain):
    follower = make_plugin(PathFollower, plain(), max_vel_x=0.8)
    assert follower.set_plan(line(0.5, 5.5))
    command = command_at(follower, Pose.planar(1.0, 3.0)).command
    assert command.vx == pytest.approx(0.8) and command.wz == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_beside_the_line_it_steers_back_equally_from_both_sides(make_plugin, plain, side):
    follower = make_plugin(PathFollower, plain())
    follower.set_plan(line(0.5, 5.5))
    command = command_at(follower, Pose.planar(2.0, 3.0 + 0.2 * side)).command
    assert command.vx > 0.3 and command.wz * side < -0.1


@pytest.mark.parametrize("yaw", [-2.5, 2.5])
def test_looking_elsewhere_it_turns_on_the_spot_within_the_symmetric_limit(make_plugin, plain, yaw):
    follower = make_plugin(PathFollower, plain(), max_vel_theta=0.9)
    follower.set_plan(line(0.5, 5.5))
    command = command_at(follower, Pose.planar(2.0, 3.0, yaw)).command
    assert command.vx == 0.0 and command.wz == pytest.approx(-math.copysign(0.9, yaw))


def test_it_slows_down_towards_the_goal(make_plugin, plain):
    follower = make_plugin(PathFollower, plain())
    follower.set_plan(line(0.5, 5.5))
    speeds = [command_at(follower, Pose.planar(x, 3.0)).command.vx for x in (4.0, 5.0, 5.3, 5.4)]
    assert speeds == sorted(speeds, reverse=True) and speeds[-1] < 0.4 * speeds[0]


def test_a_frame_above_the_ground_does_not_keep_it_from_slowing_down(make_plugin, plain):
    def speed_before_the_goal(height):
        follower = make_plugin(PathFollower, plain())
        follower.set_plan(line(0.5, 5.5))
        return command_at(follower, Pose.planar(5.4, 3.0, z=height)).command.vx

    assert speed_before_the_goal(0.5) == pytest.approx(speed_before_the_goal(0.0))


def test_at_the_goal_it_turns_to_the_final_heading(make_plugin, plain):
    follower = make_plugin(PathFollower, plain())
    follower.set_plan(Path.from_points([(1, 3, 0), (2, 3, 0)], Pose.planar(0, 0, 1.5).orientation))
    pose = Pose.planar(1.97, 3.0)
    assert command_at(follower, pose).command.wz > 0.5
    assert not follower.is_goal_reached(pose, 0.1, 0.2)
    assert follower.is_goal_reached(Pose.planar(1.97, 3.0, 1.4), 0.1, 0.2)


def test_far_from_the_path_is_missed_path_and_off_the_surface_is_out_of_map(make_plugin, plain):
    follower = make_plugin(PathFollower, plain(), max_path_distance=0.5, max_surface_distance=0.5)
    assert command_at(follower, Pose.planar(1.0, 3.0)).outcome == ExePathOutcome.INVALID_PATH
    follower.set_plan(line(0.5, 5.5))
    assert command_at(follower, Pose.planar(2.0, 4.0)).outcome == ExePathOutcome.MISSED_PATH
    assert command_at(follower, Pose.planar(2.0, 3.0, z=2.0)).outcome == ExePathOutcome.OUT_OF_MAP


@pytest.mark.parametrize("controller", [PathFollower, MPPIController])
def test_a_controller_tolerates_twice_the_distance_from_its_path_while_relaxed(make_plugin, plain, controller):
    follower = make_plugin(controller, plain(), max_path_distance=0.5)
    follower.set_plan(line(0.5, 5.5))
    missed = command_at(follower, Pose.planar(2.0, 3.8))
    follower.relaxation.grant("relax", Slack(controller_factor=2.0), until=follower.clock.now() + 5.0)
    assert missed.outcome == ExePathOutcome.MISSED_PATH
    assert command_at(follower, Pose.planar(2.0, 3.8)).success


def test_it_looks_half_as_far_ahead_for_obstacles_while_relaxed(make_plugin, plain, paint):
    walled = paint(plain(), lambda places: np.where(np.abs(places[:, 0] - 3.0) < 0.3, np.inf, 0.0))
    follower = make_plugin(PathFollower, walled, check_ahead_dist=1.5)
    follower.set_plan(line(0.5, 5.5))
    blocked = command_at(follower, Pose.planar(1.8, 3.0))
    follower.relaxation.grant("relax", Slack(controller_factor=2.0), until=follower.clock.now() + 5.0)
    assert blocked.outcome == ExePathOutcome.BLOCKED_PATH
    assert command_at(follower, Pose.planar(1.8, 3.0)).success


def test_where_the_arc_to_the_usual_point_cuts_a_corner_it_pursues_a_nearer_one(make_plugin, plain, paint):
    """From many places and headings before the corner of a block; whether or not the robot states its inertia."""

    def block(places):
        gap = np.hypot(np.maximum(3.4 - places[:, 0], 0.0), np.maximum(3.3 - places[:, 1], 0.0))
        return np.where(gap == 0.0, np.inf, np.where(gap < 0.2, 1.0, 0.0))

    navigation_map, nearer = paint(plain(), block), 0
    at_once, slowly = (make_plugin(PathFollower, navigation_map, acc_lim_x=limit) for limit in (math.inf, 1e6))
    for follower in (at_once, slowly):
        follower.set_plan(line_through((2.5, 3.8), (3.5, 2.8), (5.5, 2.8)))
    for step, yaw in itertools.product(np.arange(0.2, 0.8, 0.02), np.arange(-0.6, 0.6, 0.1)):
        pose = Pose.planar(2.5 + step, 3.8 - step, yaw)
        command, with_inertia = (command_at(follower, pose).command or Twist() for follower in (at_once, slowly))
        if command.vx > 0.0 and with_inertia.vx > 0.0:
            curvature = command.wz / command.vx
            assert curvature == pytest.approx(with_inertia.wz / with_inertia.vx)
            nearer += curvature != pytest.approx(arc_to(pose, at_once._target())[1])
    assert nearer > 10


def test_an_empty_path_and_a_path_in_another_frame_are_refused(make_plugin, plain):
    follower = make_plugin(PathFollower, plain())
    assert not follower.set_plan(Path(np.zeros((0, 3))))
    assert not follower.set_plan(Path.from_points([(1, 1, 0)], frame_id="odom"))


def test_steep_ground_is_driven_more_slowly(make_plugin, pose_on):
    from mbf_mesh_nav.map.mesh_map import MeshMap

    ramp = MeshMap.from_heights(np.tile(0.4 * np.arange(41) * 0.2, (21, 1)), 0.2, 0.2)
    follower = make_plugin(PathFollower, ramp)
    follower.set_plan(Path.from_points([(x, 2.0, 0.4 * x) for x in np.linspace(1, 7, 30)]))
    pose = pose_on(ramp, (2.0, 2.0, 0.8), (1, 0, 0.4))
    assert command_at(follower, pose).command.vx < 0.7 * follower.parameters.max_vel_x


@pytest.mark.parametrize("yaw_response", [0.6, 0.8, 1.0])
def test_a_robot_that_turns_too_slowly_still_follows_a_plan_over_hills(
    make_plugin, hills, drive, pose_on, yaw_response
):
    goal = Pose.planar(0.8, 5.0, 2.0, 0.1)
    plan = make_plugin(AStarPlanner, hills).make_plan(
        PlanRequest(Pose.planar(0.6, 0.5), goal, via=(Pose.planar(5.0, 3.0),))
    )
    follower = make_plugin(PathFollower, hills)
    assert follower.set_plan(plan.path)
    poses = drive(follower, hills, pose_on(hills, (0.6, 0.5, 0), (-1, 0.5, 0)), 60.0, yaw_response)
    assert follower.is_goal_reached(poses[-1], 0.15, 0.2), poses[-1]
    path = plan.path.positions
    deviation = [np.linalg.norm(path - pose.position, axis=1).min() for pose in poses]
    assert max(deviation) < 0.35
