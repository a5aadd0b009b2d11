"""Sensors: true where they should be, noisy by seed, and faulty on demand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mbf_abstract.geometry import Pose, Twist
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.robot_models import TURTLEBOT
from terrain.physics.robots import WheeledRobot
from terrain.physics.world import BulletWorld
from terrain.sensors.lidar import Lidar, LidarModel, camera_directions, planar_directions, ring_directions
from terrain.sensors.proprioception import Imu, Localization, PoseNoise, WheelOdometry
from terrain.sensors.rays import MovingRays, StaticRays
from terrain.worlds.generate import fractal_terrain


class PosedRobot:
    """A robot that is where the test says."""

    def __init__(self, pose: Pose, velocity: Twist | None = None) -> None:
        self.place, self.speed = pose, velocity or Twist()

    def pose(self) -> Pose:
        return self.place

    def velocity(self) -> Twist:
        return self.speed

    def rolling_velocity(self) -> Twist:
        return self.speed


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def boxed_world() -> BulletWorld:
    world = BulletWorld()
    world.add_ground_plane(-10.0, 10.0, -10.0, 10.0)
    world.add_box(Pose.planar(3.0, 0.0, z=0.5), (1.0, 8.0, 1.0))
    return world


def planar_lidar(world: BulletWorld, pose: Pose, **options: float) -> Lidar:
    casters = [StaticRays(*world.static_surface()), MovingRays(world)]
    options = {"noise": 0.0, "max_range": 8.0} | options
    model = LidarModel((0.0, 0.0, 0.4), planar_directions(), 10.0, **options)
    return Lidar(PosedRobot(pose), "scan", casters, model, rng())


def test_a_planar_lidar_sees_the_wall_where_it_is() -> None:
    with boxed_world() as world:
        scan = planar_lidar(world, Pose.planar(0.0, 1.0, 0.7)).measure(2.5)
    assert scan is not None and (scan.source, scan.frame_id, scan.stamp) == ("scan", "map", 2.5)
    assert np.allclose(scan.points[:, 0], 2.5, atol=1e-3) and 60 < scan.hits.sum() < 180
    misses = np.linalg.norm(scan.ends[~scan.hits] - scan.origin, axis=1)
    assert np.allclose(misses, 8.0) and len(scan.ends) == 360


def test_moving_bodies_hide_what_is_behind_them_and_the_own_robot_is_not_seen() -> None:
    with boxed_world() as world:
        WheeledRobot(world, TURTLEBOT, Pose.planar(0.0, 0.0))
        world.add_cylinder(Pose.planar(1.5, 0.0, z=0.8), 0.25, 1.6, moving=True)
        scan = planar_lidar(world, Pose.planar(0.0, 0.0)).measure(0.0)
    assert scan is not None
    ahead = scan.points[np.abs(scan.points[:, 1]) < 0.05]
    assert len(ahead) and ahead[:, 0] == pytest.approx(1.25, abs=0.02)
    assert np.linalg.norm(scan.points[:, :2], axis=1).min() > 1.2


def test_the_ray_tree_and_bullet_agree_on_rough_ground() -> None:
    hills = fractal_terrain(20.0, 20.0, 0.2, rng(3), median_slope=12.0, roughness=0.05)
    directions = ring_directions()
    origins = np.tile([10.0, 10.0, float(hills.height_at(10.0, 10.0)) + 1.0], (len(directions), 1))
    with BulletWorld() as world:
        world.add_mesh(*hills.surface())
        hit, points = world.cast_rays(origins, origins + 15.0 * directions)
        tree = StaticRays(*world.static_surface()).distances(origins, directions, 15.0)
    both = hit & np.isfinite(tree)
    assert both.sum() > 1000 and (hit != np.isfinite(tree)).mean() < 0.002
    assert np.abs(np.linalg.norm(points - origins, axis=1) - tree)[both].max() < 2e-3


def test_a_lidar_sees_from_where_it_is_mounted_on_the_turned_robot() -> None:
    with boxed_world() as world:
        lidar = planar_lidar(world, Pose.planar(0.0, 1.0, math.pi / 2.0))
        lidar.model = replace(lidar.model, position=(0.5, 0.2, 0.4))
        scan = lidar.measure(0.0)
    assert scan is not None and scan.origin == pytest.approx((-0.2, 1.5, 0.4))
    assert np.allclose(scan.points[:, 0], 2.5, atol=1e-3)


def test_hits_nearer_than_the_least_range_are_left_out_and_none_is_farther_than_the_largest() -> None:
    with boxed_world() as world:
        near = planar_lidar(world, Pose.planar(2.46, 0.0), min_range=0.1).measure(0.0)
        far = planar_lidar(world, Pose.planar(0.0, 0.0), noise=0.1, max_range=2.55).measure(0.0)
    assert near is not None and far is not None
    distances = np.linalg.norm(near.points - near.origin, axis=1)
    assert len(distances) and distances.min() >= 0.1 and len(near.ends) < 300
    distances = np.linalg.norm(far.points - far.origin, axis=1)
    assert distances.max() == pytest.approx(2.55) and distances.min() < 2.5


def test_noise_has_its_spread_and_drop_out_its_share_by_seed() -> None:
    with boxed_world() as world:
        lidar = planar_lidar(world, Pose.planar(0.0, 0.0), noise=0.02, drop_out=0.2)
        scans = [lidar.measure(0.1 * k) for k in range(40)]
        again = planar_lidar(world, Pose.planar(0.0, 0.0), noise=0.02, drop_out=0.2).measure(0.0)
    assert np.mean([len(scan.ends) for scan in scans if scan]) == pytest.approx(0.8 * 360, rel=0.02)
    ahead = np.concatenate([scan.points[np.abs(scan.points[:, 1]) < 0.2, 0] for scan in scans if scan])
    assert ahead.std() == pytest.approx(0.02, rel=0.2) and ahead.mean() == pytest.approx(2.5, abs=5e-3)
    assert again is not None and scans[0] is not None and np.array_equal(again.ends, scans[0].ends)


def test_a_lidar_can_be_silent_stale_or_wrong() -> None:
    with boxed_world() as world:
        lidar = planar_lidar(world, Pose.planar(0.0, 0.0))
        good = lidar.measure(0.0)
        lidar.silent = True
        assert lidar.measure(0.1) is None
        lidar.silent, lidar.stale = False, True
        assert lidar.measure(0.2) is good
        lidar.stale, lidar.wrong = False, True
        bad = lidar.measure(0.3)
    assert good is not None and bad is not None and bad.stamp == 0.3
    assert np.linalg.norm(bad.points - bad.origin, axis=1).min() == pytest.approx(1.25, abs=0.01)
    assert bad.hits.all() and len(bad.ends) == 360, "it sees something at half its range where there is nothing"


def test_rays_into_an_empty_world_hit_nothing() -> None:
    empty = StaticRays(np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    assert np.isinf(empty.distances(np.zeros((4, 3)), np.tile([1.0, 0.0, 0.0], (4, 1)), 10.0)).all()
    vertices, faces = KinematicWorld().static_surface()
    down = StaticRays(vertices, faces).distances(np.array([[0.3, 0.2, 1.0]]), np.array([[0.0, 0.0, -1.0]]), 5.0)
    assert down[0] == pytest.approx(1.0)


def test_the_imu_measures_roll_and_pitch() -> None:
    rolled = Pose((0.0, 0.0, 0.0), (math.sin(0.1), 0.0, 0.0, math.cos(0.1)))
    imu = Imu(PosedRobot(rolled, Twist((0.0, 0.0, 0.0), (0.1, 0.2, 0.3))), rng())
    tilts = [imu.measure(0.02 * k) for k in range(400)]
    assert np.mean([tilt.roll for tilt in tilts if tilt]) == pytest.approx(0.2, abs=1e-3)
    turning = np.array([tilt.angular_velocity for tilt in tilts if tilt])
    assert turning.mean(axis=0) == pytest.approx((0.1, 0.2, 0.3), abs=2e-3)
    errors = np.column_stack([turning, [(tilt.roll, tilt.pitch) for tilt in tilts if tilt]])
    assert np.abs(np.corrcoef(errors.T) - np.eye(5)).max() < 0.15, "each has noise of its own"


def test_perfect_wheel_odometry_follows_an_arc_and_a_real_one_drifts() -> None:
    robot = PosedRobot(Pose.planar(0.0, 0.0), Twist.planar(0.5, 0.0, 0.25))
    perfect = WheelOdometry(robot, rng(), scale_error=0.0, yaw_scale_error=0.0, noise=0.0)
    real = WheelOdometry(robot, rng(1))
    for step in range(501):
        ideal, drifted = perfect.measure(0.02 * step), real.measure(0.02 * step)
    assert ideal is not None and drifted is not None
    yaw, radius = 2.5, 2.0  # 10 s at 0.25 rad/s, 0.5 / 0.25 m
    truth = Pose.planar(radius * math.sin(yaw), radius * (1.0 - math.cos(yaw)), yaw)
    assert ideal.pose.distance_to(truth) < 1e-3 and ideal.pose.frame_id == "odom"
    assert 0.01 < drifted.pose.distance_to(truth) < 0.5


def test_wheel_odometry_is_wrong_in_distance_and_in_turning_by_factors_of_their_own() -> None:
    robot = PosedRobot(Pose.planar(0.0, 0.0), Twist.planar(0.5, 0.0, 0.25))
    for errors in ({"scale_error": 0.3, "yaw_scale_error": 0.0}, {"scale_error": 0.0, "yaw_scale_error": 0.3}):
        reading = WheelOdometry(robot, rng(), noise=0.0, **errors).measure(0.0)
        assert reading is not None
        velocity = reading.odometry.velocity
        assert (velocity.vx == 0.5) is (errors["scale_error"] == 0.0)
        assert (velocity.wz == 0.25) is (errors["yaw_scale_error"] == 0.0)


def test_localisation_follows_the_robot_from_where_it_was_told_that_it_is() -> None:
    robot = PosedRobot(Pose.planar(1.0, 2.0, 0.5))
    localization = Localization(robot, rng())
    localization.offset = (0.1, 0.0, 0.0)  # a fault that began before
    localization.seat(Pose.planar(4.0, 3.0, 0.5 + math.pi / 2.0))
    there = localization.measure(0.0)
    assert there is not None and (there.x, there.y, there.yaw) == pytest.approx((4.0, 3.0, 0.5 + math.pi / 2.0))
    robot.place = Pose((2.0, 2.0, 0.3), Pose.planar(0.0, 0.0, 0.7).orientation)
    moved = localization.measure(0.1)
    assert moved is not None and moved.position == pytest.approx((4.0, 4.0, 0.3))
    assert moved.yaw == pytest.approx(0.7 + math.pi / 2.0)
    localization.seat(robot.place)
    assert localization.measure(0.15) == robot.place.stamped(0.15)
    localization.offset = (0.0, 0.0, 0.0)
    found = localization.measure(0.2)
    assert found is not None and (found.x, found.y, found.yaw) == pytest.approx((1.9, 2.0, 0.7)), "the fault has ended"


def test_localisation_jumps_when_asked_to() -> None:
    localization = Localization(PosedRobot(Pose.planar(1.0, 2.0, 0.5)), rng())
    before = localization.measure(0.0)
    localization.offset = (0.5, 0.0, 0.1)
    after = localization.measure(0.1)
    assert before == Pose.planar(1.0, 2.0, 0.5) and after is not None
    assert (after.x, after.y, after.yaw) == pytest.approx((1.5, 2.0, 0.6)) and after.stamp == 0.1


def test_a_localisation_errs_in_roll_and_pitch_about_the_robots_own_axes() -> None:
    robot = PosedRobot(Pose((1.0, 2.0, 0.0), Pose.planar(0.0, 0.0, 1.2).orientation))
    pose = Localization(robot, rng(), PoseNoise(tilt=0.2)).measure(0.0)
    roll, pitch = 0.2 * rng().normal(size=6)[4:]
    tilted = Rotation.from_euler("z", 1.2) * Rotation.from_euler("x", roll) * Rotation.from_euler("y", pitch)
    assert pose is not None and pose.orientation == pytest.approx(tilted.as_quat(canonical=True))


def test_a_depth_camera_looks_ahead_from_the_top_left() -> None:
    rays = camera_directions(40, 30, math.radians(90.0))
    assert rays.shape == (1200, 3) and np.allclose(np.linalg.norm(rays, axis=1), 1.0)
    assert rays[0, 1] > 0.0 and rays[0, 2] > 0.0 and (rays[:, 0] > 0.5).all()
    widest = math.atan2(rays[0, 1], rays[0, 0])
    assert math.radians(43.0) < widest < math.radians(45.0)
