"""Controllers of both maps that know their robot's inertia: they command what it can do, and stop it on its arc."""

import math

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.geometry.arcs import arc_poses
from mbf_abstract.plugins import ControlRequest, PluginKind
from mbf_abstract.testing.contract.rig import rig

PERIOD, ACCELERATION, YAW_ACCELERATION = 0.15, 0.5, 0.8
STATED = {
    "max_vel_x": 0.8,
    "max_vel_theta": 1.0,
    "rotate_to_heading_vel": 1.0,
    "acc_lim_x": ACCELERATION,
    "acc_lim_y": ACCELERATION,
    "acc_lim_theta": YAW_ACCELERATION,
    "decel_lim_x": ACCELERATION,
    "control_period": PERIOD,
}
STEERING = {"costmap": ["regulated_pure_pursuit", "follow_path"], "mesh": ["path_follower", "follow_path"]}
SAMPLING = {"costmap": ["dwa", "mppi"], "mesh": ["mppi"]}
RADIUS = 1.5
START = Pose.planar(3.0, 1.5)
TOLERANCES = 0.45, 0.1
SLACK = 1e-6


def wall(x, y):
    """Across the path, which knows nothing of it; the circle leads by its upper end."""
    return (np.abs(x - 4.5) < 0.3) & (np.abs(y - 3.4) < 0.11)


def half_circle():
    angles = np.linspace(0.0, math.pi, 60)
    x, y = 3.0 + RADIUS * np.sin(angles), 1.5 + RADIUS * (1.0 - np.cos(angles))
    return Path.from_points(np.column_stack([x, y, np.zeros(60)]), frame_id="map")


def wall_beyond_its_end(x, y):
    """So near beyond the end of a straight path that no robot comes to it."""
    return (np.abs(x - 5.2) < 0.1) & (np.abs(y - 1.5) < 1.0)


def straight_on_and_turn():
    x = np.linspace(3.0, 5.0, 40)
    points = np.column_stack([x, np.full(40, 1.5), np.zeros(40)])
    return Path.from_points(points, Pose.planar(0.0, 0.0, 2.0).orientation, frame_id="map")


def nothing(x, y):
    return np.zeros(np.shape(x), dtype=bool)


def drive(world, name, seconds=8.0, path=half_circle, blocked=wall, share=1.0):
    """Measured velocities and results of a robot that does a share of its commands, until it is refused at rest."""
    plugin, navigation_map = PluginRegistry(world.backend).load(PluginKind.CONTROLLER, name), world.map_of(blocked)
    fields = plugin.Parameters.model_fields
    stated = {key: value for key, value in STATED.items() if key in fields}
    stated |= {"model_dt": PERIOD} if world.backend == "costmap" and name == "mppi" else {}

    def make_context(base):
        return world.context(**vars(base), navigation_map=navigation_map)

    pose, velocity, rows = START, Twist(), []
    with rig(plugin, make_context, plugin.Parameters(**stated), START) as made:
        assert made.plugin.set_plan(path())
        for _ in range(round(seconds / PERIOD)):
            if made.plugin.is_goal_reached(pose, *TOLERANCES):
                break
            result = made.plugin.compute_velocity_commands(ControlRequest(pose, velocity))
            rows.append((velocity, result))
            if not result.success:
                break
            velocity = Twist.planar(share * result.command.vx, share * result.command.vy, share * result.command.wz)
            pose = Pose.planar(
                *arc_poses((pose.x, pose.y, pose.yaw), velocity.vx, 0.0, velocity.wz, PERIOD, PERIOD)[-1]
            )
    return rows


@pytest.mark.parametrize("which", [0, 1])
def test_a_robot_that_rolls_brakes_on_its_arc_and_is_refused_once_it_stands(world, which):
    rows = drive(world, STEERING[world.backend][which])
    velocity, last = rows[-1]
    assert not last.success, "the wall is in its way"
    assert max(velocity.vx for velocity, _ in rows) > 0.5
    assert velocity.vx <= ACCELERATION * PERIOD + SLACK
    braking = [(velocity, result.command) for velocity, result in rows if result.message.startswith("it brakes: ")]
    assert len(braking) > 2
    for velocity, command in braking:
        assert command.wz * velocity.vx == pytest.approx(velocity.wz * command.vx)
        assert 0.0 < command.vx < velocity.vx


def commands_within_limits(world, name, *drive_options):
    """The commands of a drive, none of which is farther from the velocity before than a period allows."""
    rows = drive(world, name, *drive_options)
    commands = [(velocity, result.command) for velocity, result in rows if result.success]
    assert len(commands) > 10, name
    for velocity, command in commands:
        assert abs(command.vx - velocity.vx) <= ACCELERATION * PERIOD + SLACK, name
        assert abs(command.wz - velocity.wz) <= YAW_ACCELERATION * PERIOD + SLACK, name
    return [command for _, command in commands]


def test_no_command_is_farther_from_the_last_one_than_a_period_allows(world):
    for name in STEERING[world.backend] + SAMPLING[world.backend]:
        commands_within_limits(world, name)


def test_nor_where_the_path_leads_no_nearer_to_the_goal_and_only_a_turn_is_left(world):
    for name in STEERING[world.backend] + SAMPLING[world.backend]:
        commands = commands_within_limits(world, name, 12.0, straight_on_and_turn, wall_beyond_its_end)
        assert name != "follow_path" or max(command.wz for command in commands) > 0.5, "it turns to the goal's heading"


def test_a_robot_whose_wheels_slip_is_brought_up_to_its_speed(world):
    """Counted from what is measured it would be commanded 0.19 m/s for ever."""
    for name in STEERING[world.backend]:
        rows = drive(world, name, 4.0, straight_on_and_turn, nothing, 0.6)
        speeds = [result.command.vx for _, result in rows]
        assert max(speeds) > 0.5, name
        assert np.diff([0.0, *speeds]).max() <= ACCELERATION * PERIOD + SLACK, name
