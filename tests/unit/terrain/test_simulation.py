"""World, robot, sensors and actors on one time line; kinematic stand-in; the same run for the same seed."""

import math

import numpy as np
import pytest

from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from mbf_abstract.maps.sensing import RangeScan
from terrain.physics.actors import RouteWalker, SlidingDoor, other_robot
from terrain.physics.incidents import IncidentKind
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.motion_sample import Thing
from terrain.physics.robot_models import CAR, HUSKY, ROBOTS, TURTLEBOT, RobotSpec
from terrain.physics.robots import WheeledRobot
from terrain.physics.simulation import Simulation
from terrain.physics.world import BulletWorld
from terrain.recording.recorded_robot import RobotShape
from terrain.scenarios.actors import random_route
from terrain.sensors.lidar import Lidar, LidarModel, planar_directions
from terrain.sensors.proprioception import Imu, WheelOdometry
from terrain.sensors.rays import MovingRays, StaticRays
from terrain.worlds.floor_plan import OFFICE_MAP
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid, read_occupancy


def office_run(seed: int) -> tuple[list[Pose], list[RangeScan]]:
    grid = read_occupancy(OFFICE_MAP)
    with BulletWorld() as world:
        world.add_building(grid)
        RouteWalker(world, random_route(grid, np.random.default_rng(seed)), 1.0)
        robot = WheeledRobot(world, TURTLEBOT, Pose.planar(2.0, 9.7))
        robot.settle()
        casters = [StaticRays(*world.static_surface()), MovingRays(world)]
        lidar_rng, odometry_rng = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2])
        model = LidarModel(TURTLEBOT.lidar_position, planar_directions(180), 10.0)
        lidar = Lidar(robot, "scan", casters, model, lidar_rng)
        simulation = Simulation(world, robot, {"scan": lidar, "odom": WheelOdometry(robot, odometry_rng)})
        scans: list[RangeScan] = [simulation.latest["scan"]]
        simulation.on_measurement(lambda name, value: scans.append(value) if name == "scan" else None)
        for tick in range(100):
            robot.send_command(Twist.planar(0.5, 0.0, 0.2 * math.sin(0.1 * tick)))
            simulation.advance_to(0.05 * (tick + 1))
        assert simulation.time == pytest.approx(5.0)
        return simulation.track, scans


def test_five_seconds_in_the_office_repeat_bit_for_bit_and_differ_by_seed() -> None:
    (track, scans), (track_again, scans_again), (_, scans_other) = office_run(1), office_run(1), office_run(2)
    assert track == track_again and track[-1].distance_to(track[0]) > 2.0
    assert all(np.array_equal(a.ends, b.ends) for a, b in zip(scans, scans_again, strict=True))
    assert not np.array_equal(scans[-1].ends, scans_other[-1].ends)


def test_sensors_measure_at_their_rates() -> None:
    world = KinematicWorld()
    robot = KinematicRobot(world, HUSKY, Pose.planar(0.0, 0.0))
    fast, slow = Imu(robot, np.random.default_rng(0), rate=30.0), Imu(robot, np.random.default_rng(0), rate=5.0)
    simulation = Simulation(world, robot, {"fast": fast, "slow": slow})
    names: list[str] = []
    simulation.on_measurement(lambda name, _: names.append(name))
    simulation.advance_to(2.0)
    simulation.advance_to(1.0)
    assert names.count("fast") == 60 and names.count("slow") == 10 and simulation.time == pytest.approx(2.0)


def test_the_kinematic_robot_keeps_to_its_limits_and_drives_an_arc() -> None:
    world = KinematicWorld()
    robot = KinematicRobot(world, HUSKY, Pose.planar(0.0, 0.0), command_timeout=math.inf)
    robot.send_command(Twist.planar(9.0))
    world.step()
    assert robot.velocity().vx == pytest.approx(HUSKY.max_acceleration * world.time_step)
    robot = KinematicRobot(world, CAR, Pose.planar(0.0, 0.0), command_timeout=math.inf)
    robot.send_command(AckermannCommand(1.0, 0.3))
    Simulation(world, robot).advance_to(4.0)
    assert robot.velocity().wz == pytest.approx(math.tan(0.3) / CAR.wheelbase, rel=1e-6)


def test_the_kinematic_robot_stops_without_commands() -> None:
    world = KinematicWorld()
    robot = KinematicRobot(world, HUSKY, Pose.planar(0.0, 0.0))
    robot.send_command(Twist.planar(1.0))
    Simulation(world, robot).advance_to(2.0)
    assert robot.velocity() == Twist() and 0.4 < robot.pose().x < 1.0


def test_on_a_slope_the_kinematic_robot_tilts_and_covers_ground_length() -> None:
    _, x = np.mgrid[0:31, 0:31] * 0.5
    world = KinematicWorld(Heightfield(x * math.tan(math.radians(20.0)), 0.5, 0.5))
    robot = KinematicRobot(world, HUSKY, Pose.planar(2.0, 7.0), command_timeout=math.inf)
    robot.send_command(Twist.planar(1.0))
    simulation = Simulation(world, robot)
    simulation.advance_to(5.0)
    assert simulation.monitor.max_pitch == pytest.approx(math.radians(20.0), abs=1e-3)
    assert simulation.monitor.distance == pytest.approx(5.0, abs=0.3)
    robot.place(Pose.planar(14.0, 7.0))
    simulation.advance_to(10.0)
    assert robot.pose().x <= 15.0 and simulation.monitor.counts[IncidentKind.COLLISION] == 1


def test_walls_stop_the_kinematic_robot() -> None:
    grid = read_occupancy(OFFICE_MAP)
    world = KinematicWorld(building=grid)
    robot = KinematicRobot(world, TURTLEBOT, Pose.planar(2.0, 9.7, math.pi / 2), command_timeout=math.inf)
    robot.send_command(Twist.planar(0.5))
    simulation = Simulation(world, robot)
    simulation.advance_to(5.0)
    assert robot.pose().y < 11.0 and simulation.monitor.counts[IncidentKind.COLLISION] == 1
    robot.send_command(Twist.planar(-0.5))
    simulation.advance_to(6.0)
    assert robot.pose().y < 10.6


def test_the_nose_of_a_kinematic_car_stops_at_the_wall_and_not_its_axle() -> None:
    occupied = np.zeros((80, 160), dtype=bool)
    occupied[:, 100:] = True  # a wall from x = 5 m on
    world = KinematicWorld(building=OccupancyGrid(occupied, ~occupied, 0.05))
    robot = KinematicRobot(world, CAR, Pose.planar(2.0, 2.0), command_timeout=math.inf)
    robot.send_command(Twist.planar(1.0))
    simulation = Simulation(world, robot)
    simulation.advance_to(6.0)
    assert 4.9 < robot.pose().x + 0.75 <= 5.0
    assert simulation.monitor.counts[IncidentKind.COLLISION_WITH_WALL] == 1
    robot.send_command(Twist.planar(-1.0))
    simulation.advance_to(8.0)
    assert robot.pose().x < 3.0


def test_a_long_robot_cannot_turn_its_corners_through_a_wall() -> None:
    occupied = np.zeros((80, 160), dtype=bool)
    occupied[:30] = occupied[50:] = True  # a corridor of one metre
    world = KinematicWorld(building=OccupancyGrid(occupied, ~occupied, 0.05))
    robot = KinematicRobot(world, HUSKY, Pose.planar(3.0, 2.0), command_timeout=math.inf)
    robot.send_command(Twist.planar(0.0, 0.0, 0.5))
    simulation = Simulation(world, robot)
    simulation.advance_to(6.0)
    assert 0.1 < robot.pose().yaw < math.radians(60.0)  # its diagonal of 1.21 m does not fit across
    assert simulation.monitor.counts[IncidentKind.COLLISION_WITH_WALL] >= 1
    robot.send_command(Twist.planar(0.0, 0.0, -0.5))
    simulation.advance_to(6.5)
    assert robot.velocity().wz < -0.4


@pytest.mark.parametrize("shape", ["box", "cylinder"])
def test_a_robot_that_something_has_moved_into_may_move_away_but_not_deeper(shape: str) -> None:
    world = KinematicWorld()
    pose = Pose.planar(0.6, 0.0)
    body = world.add_box(pose, (0.4, 0.4, 1.0)) if shape == "box" else world.add_cylinder(pose, 0.2, 1.0)
    world.things[body] = Thing.PERSON
    robot = KinematicRobot(world, HUSKY, Pose.planar(0.0, 0.0), command_timeout=math.inf)
    assert robot.motion_sample().touched == {Thing.PERSON}
    robot.send_command(Twist.planar(0.5))
    for _ in range(60):
        world.step()
    assert robot.pose().x == 0.0
    robot.send_command(Twist.planar(-0.5))
    for _ in range(60):
        world.step()
    robot.motion_sample()
    assert robot.pose().x < -0.2 and not robot.motion_sample().touched


def test_a_short_touch_between_two_samples_is_not_missed() -> None:
    world = KinematicWorld()
    world.add_box(Pose.planar(1.0, 0.0), (0.4, 0.4, 1.0))
    robot = KinematicRobot(world, HUSKY, Pose.planar(0.295, 0.0), command_timeout=math.inf)
    robot.send_command(Twist.planar(1.0))
    for _ in range(30):
        world.step()
    robot.send_command(Twist.planar(-1.0))
    for _ in range(15):
        world.step()
    assert robot.motion_sample().touched == {Thing.WALL}
    assert not robot.motion_sample().touched


@pytest.mark.parametrize("seed", range(5))
def test_a_kinematic_car_never_drives_a_tighter_curve_than_its_turning_circle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = KinematicWorld()
    robot = KinematicRobot(world, CAR, Pose.planar(0.0, 0.0), command_timeout=math.inf)
    tightest = 1.0 / CAR.min_turning_radius
    for _ in range(200):
        vx, wz = rng.uniform(-1.5, 1.5), rng.uniform(-3.0, 3.0)
        robot.send_command(Twist.planar(vx, 0.0, wz) if rng.uniform() < 0.7 else AckermannCommand(vx, wz))
        for _ in range(rng.integers(1, 20)):
            before = robot.pose()
            world.step()
            velocity, after = robot.velocity(), robot.pose()
            assert abs(velocity.wz) <= tightest * abs(velocity.vx) + 1e-12
            assert abs(after.yaw - before.yaw) % (2.0 * math.pi) <= tightest * after.distance_to(before) * 1.001 + 1e-9


def test_a_kinematic_car_that_reverses_turns_its_wheels_before_it_turns() -> None:
    world = KinematicWorld()
    robot = KinematicRobot(world, CAR, Pose.planar(0.0, 0.0), command_timeout=math.inf)
    simulation = Simulation(world, robot)
    robot.send_command(Twist.planar(1.0, 0.0, 0.9))
    simulation.advance_to(2.0)
    robot.send_command(Twist.planar(-1.0, 0.0, 0.9))
    while robot.velocity().vx > -0.9:
        world.step()
        assert abs(robot.velocity().wz) <= abs(robot.velocity().vx) / CAR.min_turning_radius + 1e-12


def test_a_walker_is_where_its_speed_says_and_comes_back() -> None:
    with BulletWorld() as world:
        world.add_ground_plane(-5.0, 5.0, -5.0, 5.0)
        walker = RouteWalker(world, np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]), 1.0)
        for _ in range(720):
            world.step()
        assert (walker.pose().x, walker.pose().y) == pytest.approx((2.0, 1.0), abs=0.01)
        for _ in range(1200):
            world.step()
        assert (walker.pose().x, walker.pose().y) == pytest.approx((0.0, 0.0), abs=0.01)


def test_a_door_closes_at_its_time_and_stops_the_robot() -> None:
    with BulletWorld() as world:
        world.add_ground_plane(-5.0, 5.0, -5.0, 5.0)
        opened, closed = Pose.planar(1.0, 1.5, z=1.0), Pose.planar(1.0, 0.0, z=1.0)
        door = SlidingDoor(world, opened, closed, (0.08, 1.2, 2.0), closes_at=0.5, duration=1.0)
        robot = WheeledRobot(world, TURTLEBOT, Pose.planar(-0.5, 0.0), command_timeout=math.inf)
        robot.settle()
        simulation = Simulation(world, robot)
        robot.send_command(Twist.planar(0.4))
        simulation.advance_to(0.4)
        assert door.pose().y == 1.5
        simulation.advance_to(6.0)
        assert door.pose().y == 0.0 and robot.pose().x < 0.85
    kinds = {incident.kind for incident in simulation.incidents}
    assert {IncidentKind.COLLISION, IncidentKind.COLLISION_WITH_DOOR} <= kinds
    assert IncidentKind.COLLISION_WITH_WALL not in kinds


@pytest.mark.parametrize("thing", [Thing.PERSON, Thing.ROBOT])
def test_whom_the_robot_hits_is_reported(thing: Thing) -> None:
    route = np.array([[1.0, 0.0], [1.0, 0.01]])
    with BulletWorld() as world:
        world.add_ground_plane(-5.0, 5.0, -5.0, 5.0)
        if thing is Thing.ROBOT:
            other_robot(world, TURTLEBOT, route, 0.0)
        else:
            RouteWalker(world, route, 0.0)
        robot = WheeledRobot(world, TURTLEBOT, Pose.planar(0.0, 0.0), command_timeout=math.inf)
        robot.settle()
        simulation = Simulation(world, robot)
        robot.send_command(Twist.planar(0.4))
        simulation.advance_to(3.0)
    kinds = {incident.kind.value for incident in simulation.incidents}
    assert {kind for kind in kinds if kind.startswith("collision_with_")} == {f"collision_with_{thing.value}"}


@pytest.mark.parametrize("spec", ROBOTS.values(), ids=lambda spec: spec.name)
def test_another_robot_looks_like_its_model_and_fills_its_box(spec: RobotSpec) -> None:
    with BulletWorld() as world:
        robot = other_robot(world, spec, np.array([[0.0, 0.0], [2.0, 0.0]]), 1.0)
        assert robot.pose().z == pytest.approx(0.5 * spec.height)
        vertices, faces = robot.looks
        assert len(faces) > 12 + 90 * len(RobotShape.of(spec).wheels)
        assert np.ptp(vertices[:, 2]) == pytest.approx(spec.height)
        assert (np.ptp(vertices[:, :2], axis=0) <= np.ptp(spec.footprint_array(), axis=0) + 0.05).all()


def test_random_routes_keep_clear_of_walls() -> None:
    grid = read_occupancy(OFFICE_MAP)
    route = random_route(grid, np.random.default_rng(5), corners=5)
    assert route.shape == (5, 2) and all(grid.is_free(x, y) for x, y in route)
    with pytest.raises(ValueError, match="no route"):
        random_route(grid, np.random.default_rng(5), clearance=9.0)
