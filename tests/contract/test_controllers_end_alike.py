"""Every controller of both maps in the same situation: a robot that touches something, a path far away, no path."""

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.geometry import Path, Pose, Twist, normalize_angle
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlRequest, PluginKind
from mbf_abstract.testing.contract.rig import rig

START = Pose.planar(4.0, 3.0)
CONTROLLERS = {
    "costmap": ["regulated_pure_pursuit", "dwa", "mppi", "rotation_shim", "follow_path"],
    "mesh": ["path_follower", "mppi", "follow_path"],
}
AWAY = Path.from_points([(4.0 + 0.1 * k, 3.0, 0.0) for k in range(26)], frame_id="map")
FAR = Path.from_points([(2.0 + 0.1 * k, 5.4, 0.0) for k in range(26)], frame_id="map")
INTO = Path.from_points([(4.0 - 0.1 * k, 3.0, 0.0) for k in range(26)], frame_id="map")
PERIOD = 0.05


def wall(x, y):
    """Its face is 0.12 m behind the middle of the robot, whose radius is 0.2 m."""
    return (x < 3.88) & (x > 3.4)


def pole(x, y):
    """A cell, or a vertex, under the rear of the robot."""
    return (np.abs(x - 3.85) < 0.051) & (np.abs(y - 3.0) < 0.051)


@pytest.fixture(params=[wall, pole])
def controllers(world, request):
    """Pairs of a controller's name and a function ``follow(path, yaw)`` -> outcomes and poses of 4 s of driving."""
    navigation_map = world.map_of(request.param)

    def make_context(base):
        return world.context(**vars(base), navigation_map=navigation_map)

    def follower(name):
        def follow(path, yaw):
            plugin = PluginRegistry(world.backend).load(PluginKind.CONTROLLER, name)
            with rig(plugin, make_context, None, START) as made:
                assert made.plugin.set_plan(path)
                return drive(made.plugin, Pose.planar(4.0, 3.0, yaw))

        return follow

    return [(name, follower(name)) for name in CONTROLLERS[world.backend]]


def drive(controller, pose):
    """Commands of a controller to a robot that obeys them at once, until it fails."""
    velocity, outcomes, track = Twist(), [], [pose]
    for _ in range(80):
        result = controller.compute_velocity_commands(ControlRequest(pose, velocity))
        outcomes.append(result.outcome)
        if not result.success:
            break
        velocity = result.command
        yaw = normalize_angle(pose.yaw + PERIOD * velocity.wz)
        x, y = pose.x + PERIOD * velocity.vx * np.cos(yaw), pose.y + PERIOD * velocity.vx * np.sin(yaw)
        pose = Pose.planar(x, y, yaw)
        track.append(pose)
    return outcomes, track


def test_every_controller_drives_out_along_a_path_that_leads_away(controllers):
    for name, follow in controllers:
        outcomes, track = follow(AWAY, 0.0)
        assert set(outcomes) == {ExePathOutcome.SUCCESS}, (name, outcomes[-1])
        assert min(pose.x for pose in track) > 3.98 and track[-1].x > 4.5, name


def test_no_controller_goes_deeper_along_a_path_that_leads_into_the_obstacle(controllers):
    for name, follow in controllers:
        outcomes, track = follow(INTO, np.pi)
        assert min(pose.x for pose in track) > 3.98, name
        if name not in SAMPLING:
            assert outcomes[-1] == ExePathOutcome.COLLISION, (name, outcomes[-1])


def test_a_path_farther_away_than_allowed_is_missed_with_every_controller(controllers):
    for name, follow in controllers:
        outcomes, track = follow(FAR, 0.0)
        assert outcomes[-1] == ExePathOutcome.MISSED_PATH, (name, outcomes[-1])
        assert track[-1].distance_to(START) < 0.01, name  # one may turn to its path before it asks the other


SAMPLING = {"dwa", "mppi", "rotation_shim"}
"""They may find a motion that leads out beside the path."""
