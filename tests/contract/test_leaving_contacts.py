"""Robots that touch a pillar, on both maps: how deep they are, and how every controller gets them out."""

import math

import numpy as np
import pytest

from mbf_abstract.config.registry import PluginRegistry
from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Path, Pose, Twist
from mbf_abstract.maps.controllers.driving_out import DriveOut, Gears, OnPath
from mbf_abstract.plugins import ControlRequest, PluginKind
from mbf_abstract.testing.contract.rig import rig

CONTROLLERS = {
    "costmap": ["regulated_pure_pursuit", "dwa", "mppi", "rotation_shim", "follow_path"],
    "mesh": ["path_follower", "mppi", "follow_path"],
}
LOW, HIGH = np.array([3.0, 2.0]), np.array([4.0, 3.0])
"""Corners of the pillar [m]."""
RADIUS, PERIOD = 0.2, 0.05


def pillar(x, y):
    return (x > LOW[0] - 0.01) & (x < HIGH[0] + 0.01) & (y > LOW[1] - 0.01) & (y < HIGH[1] + 0.01)


def touching(rng):
    """A pose on any side of the pillar or at a corner of it, up to 5 cm deep, with any heading."""
    angle, depth = rng.uniform(-math.pi, math.pi), rng.uniform(0.015, 0.05)
    on_side = rng.uniform(LOW, HIGH)
    axis, high = int(rng.integers(2)), bool(rng.integers(2))
    on_side[axis] = HIGH[axis] if high else LOW[axis]
    out = np.zeros(2)
    out[axis] = 1.0 if high else -1.0
    if rng.random() < 0.3:
        corner = np.where(rng.integers(2, size=2) == 1, HIGH, LOW)
        out = (corner - 0.5 * (LOW + HIGH)) / np.hypot(*(corner - 0.5 * (LOW + HIGH)))
        on_side = corner
    x, y = on_side + (RADIUS - depth) * out
    return Pose.planar(float(x), float(y), angle)


def moved(pose, command):
    yaw = pose.yaw + PERIOD * command.wz
    step = PERIOD * command.vx
    return Pose.planar(pose.x + step * math.cos(yaw), pose.y + step * math.sin(yaw), yaw)


def past_the_pillar(pose):
    """A path that was planned 0.5 m beside the pillar, along the side the robot is at, seen from where it is."""
    above = pose.y > 2.5
    xs = np.linspace(1.0, 7.0, 121)
    return Path(np.column_stack([xs, np.full(121, 3.5 if above else 1.5), 0.0 * xs]))


def leads_out(distance):
    """Poses of a path that is free."""
    return [Pose.planar(2.0, 2.52)]


def test_depth_is_none_where_nothing_is_touched_and_grows_towards_the_obstacle(world):
    navigation_map = world.inflated(pillar)
    depths = [navigation_map.contact_depth(Pose.planar(x, 2.52)) for x in (2.0, 2.7, 2.83, 2.87, 2.9)]
    assert depths[:2] == [0.0, 0.0] and 0.0 < depths[2] < depths[3] < depths[4] < 0.25
    assert depths[4] - depths[2] == pytest.approx(0.07, abs=0.03)


def test_whoever_reaches_over_the_corner_of_a_pillar_touches_it(world):
    """On a mesh the centre of such a robot is often on ground that is free, as the nearest vertex is."""
    navigation_map, rng = world.inflated(pillar), np.random.default_rng(0)
    for _ in range(200):
        right, above = (bool(rng.integers(2)) for _ in range(2))
        angle = rng.uniform(0.0, 0.5 * math.pi)
        distance = RADIUS - rng.uniform(0.002, 0.02)
        x = HIGH[0] + distance * math.cos(angle) if right else LOW[0] - distance * math.cos(angle)
        y = HIGH[1] + distance * math.sin(angle) if above else LOW[1] - distance * math.sin(angle)
        pose = Pose.planar(float(x), float(y), rng.uniform(-math.pi, math.pi))
        assert 0.0 < navigation_map.contact_depth(pose) < 0.1, pose


def test_who_turns_drives_out_as_soon_as_that_leads_out(world):
    """Somebody stood in the way when it chose to turn, and has left."""
    busy = world.inflated(lambda x, y: pillar(x, y) | (np.hypot(x - 2.5, y - 2.2) < 0.15))
    free, way, turns = world.inflated(pillar), DriveOut(), []
    pose = Pose.planar(2.83, 2.52, -2.4)
    turn = lambda angle: turns.append(angle) or Twist.planar(wz=1.0)  # noqa: E731
    assert way.command(busy, pose, -2.0, turn, Gears(), leads_out).wz == 1.0 and turns
    assert way.command(free, pose, -2.0, turn, Gears(), leads_out).vx > 0.0


def test_who_leads_out_steeply_drives_straight_else_it_turns(world):
    navigation_map, turns = world.inflated(pillar), []

    def command(yaw, gears, bearing=0.0):
        turns.clear()
        pose = Pose.planar(2.83, 2.52, yaw)
        turn = lambda angle: turns.append(angle) or Twist()  # noqa: E731
        return DriveOut().command(navigation_map, pose, bearing, turn, gears, leads_out)

    assert command(math.pi, Gears()).vx > 0.0, "it looks away from the face"
    assert command(0.0, Gears(reverses=True)).vx < 0.0, "it looks at it"
    command(0.0, Gears(), bearing=2.4)
    assert turns == [2.4], "to its path, which leads out"
    command(0.0, Gears(), bearing=0.2)
    assert turns and abs(turns[0]) > 1.5, "away from its path, which does not"
    free = Pose.planar(2.5, 2.52)
    assert DriveOut().command(navigation_map, free, 0.0, Twist, Gears(), leads_out) is None, "it touches nothing"


@pytest.mark.parametrize(
    ("yaw", "offset", "leads"),
    [(math.pi, 0.0, True), (0.0, 0.0, False), (0.5 * math.pi, 0.0, False), (0.5 * math.pi, -0.1, True)],
)
def test_no_way_is_taken_where_the_path_leads_farther_in_or_along_what_is_touched(world, yaw, offset, leads):
    """Out of the face, into it, along it, and along it where nothing is touched."""
    navigation_map, start = world.inflated(pillar), Pose.planar(2.83, 2.52, math.pi)
    along = np.linspace(0.0, 1.0, 21)
    xs, ys = start.x + offset + along * math.cos(yaw), start.y + along * math.sin(yaw)
    tracker = PathTracker(Path(np.column_stack([xs, ys, 0.0 * along])), dimensions=2)
    tracker.update((start.x, start.y))
    chosen = DriveOut().command(navigation_map, start, 0.0, Twist, Gears(reverses=True), OnPath(tracker, start))
    assert (chosen is not None) == leads


class BetweenTwo:
    """A gap between two things: 1 cm ahead and 1 cm behind its middle the outline touches one of them by 5 mm."""

    def contact_depth(self, pose):
        return 0.005 if 0.01 <= abs(pose.x) <= 0.02 else 0.0

    def obstacle_on_path(self, pose, command, duration):
        """What is touched keeps the robot from driving on towards it."""
        deeper = self.contact_depth(pose) > 0.0 and command.vx * math.cos(pose.yaw) * pose.x > 0.0
        return "deeper" if deeper else ""


def test_a_robot_between_two_things_does_not_drive_to_and_fro():
    """From each the straight way out is back, to the other one; it did so until it counted as stuck."""
    way, pose, speeds = DriveOut(), Pose.planar(0.012, 0.0), []
    turn = lambda angle: Twist.planar(wz=math.copysign(1.0, angle))  # noqa: E731
    for _ in range(40):
        command = way.command(BetweenTwo(), pose, 0.0, turn, Gears(reverses=True), leads_out)
        if command is None or command.wz != 0.0:
            return
        speeds.append(command.vx)
        pose = moved(pose, command)
    assert np.count_nonzero(np.diff(np.sign(speeds))) <= 1, "it drives to and fro"


def test_a_way_is_kept_until_the_robot_is_clear(world):
    navigation_map, way, pose = world.inflated(pillar), DriveOut(), Pose.planar(2.83, 2.52, math.pi)
    driven = 0.0
    while (command := way.command(navigation_map, pose, 0.0, Twist, Gears(), leads_out)) is not None:
        pose, driven = moved(pose, command), driven + PERIOD * command.vx
        assert command.wz == 0.0 and driven < 0.3
    assert navigation_map.contact_depth(pose) == 0.0 and driven > 0.05
    assert navigation_map.contact_depth(Pose.planar(pose.x + 0.02, pose.y)) == 0.0, "not only just"


def test_no_controller_stops_half_way_out_because_it_gets_far_from_its_path(world):
    start = Pose.planar(4.16, 2.52, 0.8)
    for name in CONTROLLERS[world.backend]:
        navigation_map = world.inflated(pillar)
        assert navigation_map.contact_depth(start) > 0.0

        def make_context(base, navigation_map=navigation_map):
            return world.context(**vars(base), navigation_map=navigation_map)

        plugin = PluginRegistry(world.backend).load(PluginKind.CONTROLLER, name)
        with rig(plugin, make_context, None, start) as made:
            farthest = getattr(made.plugin.parameters, "max_path_distance", 1.0)
            xs, far = np.linspace(2.5, 7.0, 91), start.y - min(farthest, 1.0) + 0.02
            assert made.plugin.set_plan(Path(np.column_stack([xs, np.full(91, far), 0.0 * xs])))
            pose, velocity = start, Twist()
            for _ in range(round(8.0 / PERIOD)):
                result = made.plugin.compute_velocity_commands(ControlRequest(pose, velocity))
                assert result.success, (name, pose, result.message)
                velocity = result.command
                pose = moved(pose, velocity)
                made.clock.sleep(PERIOD)
                if navigation_map.contact_depth(pose) == 0.0:
                    break
        assert navigation_map.contact_depth(pose) == 0.0, (name, pose)


@pytest.mark.parametrize("seed", range(6))
def test_every_controller_gets_out_of_any_contact_and_no_deeper(world, seed):
    start = touching(np.random.default_rng([7, seed]))
    for name in CONTROLLERS[world.backend]:
        navigation_map = world.inflated(pillar)
        depth = navigation_map.contact_depth(start)

        def make_context(base, navigation_map=navigation_map):
            return world.context(**vars(base), navigation_map=navigation_map)

        plugin = PluginRegistry(world.backend).load(PluginKind.CONTROLLER, name)
        with rig(plugin, make_context, None, start) as made:
            assert made.plugin.set_plan(past_the_pillar(start))
            pose, velocity, free = start, Twist(), 0
            for _ in range(round(8.0 / PERIOD)):
                made.plugin.is_goal_reached(pose, 0.1, 0.1)
                result = made.plugin.compute_velocity_commands(ControlRequest(pose, velocity))
                assert result.success, (name, start, pose, result.message)
                velocity = result.command
                pose = moved(pose, velocity)
                here = navigation_map.contact_depth(pose)
                assert here <= depth + 0.015, (name, start, pose)
                free = free + 1 if here == 0.0 else 0
                if free > 10:
                    break
                made.clock.sleep(PERIOD)
        assert free > 10, (name, start, pose)
