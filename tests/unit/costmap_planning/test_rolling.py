"""A robot that rolls is slow before a narrow gap, does not turn on the spot there, and gets through."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.maps.controllers.inertia import braking_distance
from mbf_abstract.maps.controllers.room_to_turn import CREEPING
from mbf_abstract.maps.controllers.tight_places import CLOSE_FROM, speed_before
from mbf_abstract.plugins import ControlRequest
from mbf_costmap_nav.control.rolling import rolled_poses
from mbf_costmap_nav.controllers.regulated_pure_pursuit import RegulatedPurePursuitController
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from unit.costmap_planning.long_robot import LONG_ROBOT, RESOLUTION, walled

PERIOD = 0.05
SLUGGISH = {
    "max_vel_x": 0.6,
    "acc_lim_x": 0.5,
    "acc_lim_theta": 2.0,
    "max_vel_theta": 1.0,
    "rotate_to_heading_vel": 1.0,
}
CHANGE = 0.5 * PERIOD + 1e-9
UPWARD = Pose.planar(0.0, -3.0, 0.5 * math.pi)


def drive(controller, costmap, pose, path, seconds=60.0):
    """Follow a path with inertia: poses, speeds and commands of all cycles, and how often the outline touched."""
    assert controller.set_plan(path)
    check, v, w, touched, driven = FootprintCheck(LONG_ROBOT, RESOLUTION), 0.0, 0.0, 0, []
    for _ in range(round(seconds / PERIOD)):
        if controller.is_goal_reached(pose, 0.15, math.pi):
            break
        command = controller.compute_velocity_commands(ControlRequest(pose, Twist.planar(v, wz=w))).command or Twist()
        driven.append((pose, v, command))
        v += min(max(command.vx - v, -0.5 * PERIOD), 0.5 * PERIOD)
        w += min(max(command.wz - w, -2.0 * PERIOD), 2.0 * PERIOD)
        state = arc_poses((pose.x, pose.y, pose.yaw), v, 0.0, w, PERIOD, PERIOD)[-1].tolist()
        pose, touched = Pose.planar(*state), touched + check.collides(costmap, *state)
    return driven, touched, pose


def bend_into_channel(corner, y=0.0):
    """A path up along x = 0, around a bend of a radius [m], and along y to the left."""
    up = [(0.0, -3.0 + 0.05 * k) for k in range(round((3.0 + y - corner) / 0.05))]
    angles = np.linspace(0.0, 0.5 * math.pi, 12)
    bend = [(-corner + corner * math.cos(a), y - corner + corner * math.sin(a)) for a in angles]
    left = [(-corner - 0.05 * k, y) for k in range(1, round((4.0 - corner) / 0.05))]
    return Path.from_points([(px, py, 0.0) for px, py in up + bend + left])


CHANNELS = [(0.95, 0.4, -0.6), (0.95, 0.4, -0.9), (0.95, 0.1, -0.9), (0.8, 0.1, -0.9), (0.7, 0.4, -1.2)]


def channel(width, begins):
    """Two racks of 1.3 m, ``width`` [m] apart, to the left of x = ``begins`` [m]."""
    half = 0.5 * width
    return walled((begins - 1.3, begins, half, half + 0.2), (begins - 1.3, begins, -half - 0.2, -half))


@pytest.mark.parametrize(("width", "corner", "begins"), CHANNELS)
def test_behind_a_bend_it_gets_into_a_channel_without_a_turn_on_the_spot_at_speed(make_plugin, width, corner, begins):
    costmap = channel(width, begins)
    controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=LONG_ROBOT, **SLUGGISH)
    driven, touched, end = drive(controller, costmap, UPWARD, bend_into_channel(corner))
    assert touched == 0 and end.distance_to(Pose.planar(-4.0, 0.0)) < 0.3
    assert not any(v > CREEPING + CHANGE and command.vx == 0.0 != command.wz for _, v, command in driven)
    assert all(abs(command.wz) <= SLUGGISH["max_vel_theta"] for _, _, command in driven)


@pytest.mark.parametrize("fastest", [0.6, 1.0])
def test_where_it_is_driven_closely_it_has_braked_to_creeping(make_plugin, fastest):
    costmap, limits = channel(0.7, -1.0), {**SLUGGISH, "max_vel_x": fastest}
    controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=LONG_ROBOT, **limits)
    path = Path.from_points([(4.5 - 0.05 * k, 0.0, 0.0) for k in range(150)])
    driven, touched, _ = drive(controller, costmap, Pose.planar(4.5, 0.0, math.pi), path)
    assert touched == 0
    gap = -1.0 + 0.43  # where the outline's front is in the gap
    assert all(v <= CREEPING + CHANGE for pose, v, _ in driven if 0.1 < pose.x - gap < CLOSE_FROM - 0.2)
    brakes_at = CLOSE_FROM + braking_distance(fastest, 0.5) + 0.2
    assert all(v > 0.95 * fastest for pose, v, _ in driven if brakes_at < pose.x - gap < 3.0), "not before"


@pytest.mark.parametrize("bearing", [-2.0, 0.9])
def test_a_turn_on_the_spot_that_is_free_only_for_a_robot_that_stands_waits_until_it_does(make_plugin, bearing):
    costmap = walled((0.6, 0.8, -2.0, 2.0))  # it could turn where it stands, but rolls 0.16 m farther
    controller = make_plugin(RegulatedPurePursuitController, costmap, footprint=LONG_ROBOT, **SLUGGISH)
    path = Path.from_points([(0.1 * k * math.cos(bearing), 0.1 * k * math.sin(bearing), 0.0) for k in range(20)])
    assert controller.set_plan(path)
    standing = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.0, 0.0), Twist()))
    assert standing.command.vx == 0.0 != standing.command.wz
    turning = math.copysign(0.8, bearing)
    rolling = controller.compute_velocity_commands(ControlRequest(Pose.planar(0.0, 0.0), Twist.planar(0.4, wz=turning)))
    assert rolling.command is None or rolling.command.wz == 0.0


@pytest.mark.parametrize("speed", [0.1, -0.1, 0.3, 0.6, 2.0])
def test_a_robot_brakes_to_creeping_over_the_distance_that_it_is_said_to_roll(speed):
    assert speed_before(CLOSE_FROM + braking_distance(speed, 0.5), 0.5) == pytest.approx(abs(speed))


@pytest.mark.parametrize("command", [Twist(), Twist.planar(wz=0.8), Twist.planar(0.1, wz=0.2), Twist.planar(-0.1)])
@pytest.mark.parametrize("speed", [0.6, -0.4])
def test_the_poses_of_a_rolling_robot_are_those_of_small_steps(command, speed):
    times = {"step": 0.02, "duration": 1.0, "turning": 0.6}
    poses, driven = rolled_poses(Pose.planar(1.0, 2.0, 0.5), speed, command, 0.5, 1.0, **times)
    x, y, yaw, v, length, fine = 1.0, 2.0, 0.5, speed, 0.0, 1e-4
    for step in range(10_000):
        rate = min(max(command.wz / command.vx * v, -1.0), 1.0) if command.vx else command.wz * (step * fine < 0.6)
        x, y, yaw = x + fine * v * math.cos(yaw), y + fine * v * math.sin(yaw), yaw + fine * rate
        length += fine * abs(v)
        v += min(max(command.vx - v, -0.5 * fine), 0.5 * fine)
    assert len(poses) == 50
    assert poses[-1] == pytest.approx((x, y, yaw), abs=2e-3) and driven[-1] == pytest.approx(length, abs=2e-3)
