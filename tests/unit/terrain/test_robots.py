"""Simulated robots: commands become motion through wheels, the same way every time."""

import math
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from mbf_abstract.geometry import AckermannCommand, Pose, Twist, normalize_angle
from mbf_abstract.geometry.tilt import tilt_of
from terrain.physics.incidents import IncidentKind, IncidentMonitor
from terrain.physics.robot_models import CAR, HUSKY, ROBOTS, TURTLEBOT, RobotSpec
from terrain.physics.robots import WheeledRobot
from terrain.physics.world import BulletWorld
from terrain.worlds.generate import fractal_terrain
from terrain.worlds.heightfield import Heightfield


def drive(world: BulletWorld, robot: WheeledRobot, command: Twist | AckermannCommand, seconds: float) -> list[Pose]:
    poses = []
    for _ in range(round(seconds * 20)):
        robot.send_command(command)
        for _ in range(12):
            world.step()
        poses.append(robot.pose())
    return poses


def on_flat_ground(world: BulletWorld, spec: RobotSpec) -> WheeledRobot:
    world.add_ground_plane(-20.0, 20.0, -20.0, 20.0)
    robot = WheeledRobot(world, spec, Pose.planar(1.0, 2.0, 0.5))
    robot.settle()
    return robot


def mean_yaw_rate(poses: list[Pose]) -> float:
    turns = [normalize_angle(b.yaw - a.yaw) for a, b in pairwise(poses)]
    return 20.0 * float(np.mean(turns))


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_after_settling_base_link_stands_on_the_ground_at_rest(name: str) -> None:
    with BulletWorld() as world:
        robot = on_flat_ground(world, ROBOTS[name])
        pose = robot.pose()
        assert world.time == 0.0 and pose.stamp == 0.0
        assert pose.position == pytest.approx((1.0, 2.0, 0.0), abs=5e-3) and pose.yaw == pytest.approx(0.5, abs=1e-2)
        assert robot.velocity().is_stopped(5e-3, 5e-3)


@pytest.mark.parametrize(("spec", "speed"), [(HUSKY, 0.8), (TURTLEBOT, 0.5), (CAR, 1.0)])
def test_straight_speed_is_the_commanded_one(spec: RobotSpec, speed: float) -> None:
    with BulletWorld() as world:
        robot = on_flat_ground(world, spec)
        drive(world, robot, Twist.planar(speed), 2.0)
        assert robot.velocity().vx == pytest.approx(speed, rel=0.02)
        assert robot.rolling_velocity().vx == pytest.approx(speed, rel=0.02)
        assert abs(robot.pose().yaw - 0.5) < 0.02


@pytest.mark.parametrize(("spec", "tolerance"), [(HUSKY, 0.15), (TURTLEBOT, 0.01), (CAR, 0.1)])
def test_yaw_rate_on_an_arc_is_the_commanded_one(spec: RobotSpec, tolerance: float) -> None:
    with BulletWorld() as world:
        poses = drive(world, on_flat_ground(world, spec), Twist.planar(0.5, 0.0, 0.5), 3.0)
    assert mean_yaw_rate(poses[20:]) == pytest.approx(0.5, rel=tolerance)


def test_the_husky_turns_on_the_spot_thanks_to_the_contact_set_up() -> None:
    with BulletWorld() as world:
        poses = drive(world, on_flat_ground(world, HUSKY), Twist.planar(0.0, 0.0, 1.0), 3.0)
    assert mean_yaw_rate(poses[20:]) == pytest.approx(1.0, rel=0.1)
    assert poses[-1].distance_to(poses[0]) < 0.3


def test_a_car_follows_its_steering_angle_and_refuses_nothing_else() -> None:
    with BulletWorld() as world:
        poses = drive(world, on_flat_ground(world, CAR), AckermannCommand(0.6, 0.3), 4.0)
    assert mean_yaw_rate(poses[40:]) == pytest.approx(0.6 * math.tan(0.3) / CAR.wheelbase, rel=0.1)
    with BulletWorld() as world, pytest.raises(TypeError, match="cannot steer: expected a Twist"):
        on_flat_ground(world, HUSKY).send_command(AckermannCommand(0.5, 0.1))


def test_commands_beyond_the_limits_are_clipped() -> None:
    with BulletWorld() as world:
        robot = on_flat_ground(world, HUSKY)
        drive(world, robot, Twist.planar(25.0), 2.0)
        assert robot.velocity().vx == pytest.approx(HUSKY.max_speed, rel=0.02)


def test_motors_stop_when_commands_cease() -> None:
    with BulletWorld() as world:
        robot = on_flat_ground(world, HUSKY)
        drive(world, robot, Twist.planar(0.8), 1.0)
        for _ in range(240):
            world.step()
        assert robot.velocity().is_stopped(0.02, 0.02)


def test_five_seconds_on_rough_ground_repeat_bit_for_bit() -> None:
    def run() -> list[Pose]:
        hills = fractal_terrain(12.0, 12.0, 0.1, np.random.default_rng(4), median_slope=10.0, roughness=0.02)
        with BulletWorld() as world:
            world.add_heightfield(hills)
            robot = WheeledRobot(world, HUSKY, hills.pose_at(3.0, 3.0, 0.6))
            robot.settle()
            return drive(world, robot, Twist.planar(0.8, 0.0, 0.1), 5.0)

    first, second = run(), run()
    assert first == second and first[-1].distance_to(first[0]) > 2.0


def slope(degrees: float) -> Heightfield:
    _, x = np.mgrid[0:61, 0:61] * 0.2
    return Heightfield(x * math.tan(math.radians(degrees)), 0.2, 0.2, -3.0, -6.0)


@pytest.mark.parametrize(("degrees", "slips"), [(20.0, False), (35.0, True)])
def test_crossing_a_slope_slips_only_where_it_is_steep(degrees: float, slips: bool) -> None:
    hill, monitor = slope(degrees), IncidentMonitor()
    with BulletWorld() as world:
        world.add_heightfield(hill)
        robot = WheeledRobot(world, HUSKY, hill.pose_at(2.0, -2.0, math.pi / 2))
        robot.settle()
        assert tilt_of(robot.pose()) == pytest.approx(math.radians(degrees), abs=0.02)
        for _ in range(60):
            drive(world, robot, Twist.planar(0.8), 0.05)
            monitor.update(robot.motion_sample())
    assert (monitor.counts[IncidentKind.SLIPPING] > 0) is slips


def test_a_wall_is_a_collision_and_leaves_the_robot_stuck() -> None:
    monitor = IncidentMonitor()
    with BulletWorld() as world:
        robot = on_flat_ground(world, TURTLEBOT)
        robot.place(Pose.planar(0.0, 0.0))
        world.add_box(Pose.planar(1.0, 0.0, z=0.5), (0.2, 4.0, 1.0))
        for _ in range(140):
            drive(world, robot, Twist.planar(0.4), 0.05)
            monitor.update(robot.motion_sample())
        assert robot.pose().x < 0.75
    assert monitor.counts[IncidentKind.COLLISION] >= 1 and monitor.counts[IncidentKind.STUCK] == 1


def test_importing_and_loading_prints_nothing() -> None:
    code = (
        "from terrain.physics.world import BulletWorld; from terrain.physics.robots import WheeledRobot; "
        "from terrain.physics.robot_models import HUSKY; from mbf_abstract.geometry import Pose; "
        "w = BulletWorld(); WheeledRobot(w, HUSKY, Pose.planar(0, 0)); w.close()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "" and done.stderr == ""
