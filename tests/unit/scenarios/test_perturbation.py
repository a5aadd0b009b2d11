"""What a run may change: start, friction, mass, noise and delay, drawn from its seed; noise of pose and map."""

import math

import numpy as np
import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.tilt import tilt_of
from terrain.physics.command_delay import CommandDelay
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.robot_models import HUSKY, TURTLEBOT
from terrain.physics.robots import WheeledRobot
from terrain.physics.world import BulletWorld
from terrain.scenarios.environment import build_environment, with_noise
from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.noise import LocalizationNoise, MapNoise
from terrain.scenarios.perturbation import Disturbance, Perturbation, draw_disturbance
from terrain.scenarios.places import PlanarPose
from terrain.scenarios.scenario import load_scenario
from terrain.scenarios.sensors import make_localization
from terrain.sensors.proprioception import Localization
from terrain.session.runner import RunOptions, run_scenario
from terrain.worlds.generate import flat_terrain
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid

FULL = Perturbation(start_position=0.05, start_yaw=3.0, friction=0.2, mass=0.1)


def stays(name, tmp_path, **changes):
    """Vertices of the map that a shipped scenario's server would get."""
    scenario = load_scenario(name).model_copy(update=changes)
    world, _ = build_environment(scenario, tmp_path, seed=1)
    world.physics.close()
    return (tmp_path / "world.ply").read_bytes(), world


def test_each_seed_draws_its_own_disturbance_within_the_limits_and_the_same_one_again():
    drawn = [draw_disturbance(FULL, seed) for seed in range(200)]
    assert drawn == [draw_disturbance(FULL, seed) for seed in range(200)]
    assert len(set(drawn)) == 200
    for name, middle, most in [("dx", 0.0, 0.05), ("dyaw", 0.0, math.radians(3.0)), ("friction", 1.0, 0.2)]:
        values = np.array([getattr(each, name) for each in drawn])
        assert np.abs(values - middle).max() <= most
        assert values.min() < middle - 0.8 * most and values.max() > middle + 0.8 * most


def test_without_a_perturbation_nothing_is_different():
    assert draw_disturbance(Perturbation(), 7) == Disturbance()


def test_one_kind_of_disturbance_does_not_shift_the_draws_of_another():
    alone = draw_disturbance(Perturbation(mass=0.1), 5)
    assert alone.mass == draw_disturbance(FULL, 5).mass


def test_a_start_by_coordinates_stays_on_the_ground_and_a_named_one_on_its_level(tmp_path):
    moved = Disturbance(dx=0.05, dy=-0.04, dyaw=0.05)
    _, hills = stays("crater_rim", tmp_path)
    pose = moved.moved(PlanarPose(x=5.0, y=14.0), hills.pose_of)
    assert pose.z == pytest.approx(hills.height_at(5.05, 13.96))
    _, garage = stays("garage_roof", tmp_path)
    pose, named = moved.moved("entrance", garage.pose_of), garage.pose_of("entrance")
    assert (pose.x - named.x, pose.y - named.y, pose.z) == pytest.approx((0.05, -0.04, named.z))
    assert pose.yaw == pytest.approx(0.05)


def test_mass_and_friction_reach_every_part_of_the_robot_in_bullet():
    with BulletWorld() as world:
        world.add_ground_plane(-5.0, 5.0, -5.0, 5.0)
        robots = [
            WheeledRobot(world, HUSKY, Pose.planar(x, 0.0), friction=friction, mass_factor=factor)
            for x, friction, factor in [(-2.0, 1.0, 1.0), (2.0, 0.8, 1.1)]
        ]
        found = []
        for robot in robots:
            links = range(-1, world.bullet.getNumJoints(robot.body))
            infos = [world.bullet.getDynamicsInfo(robot.body, k) for k in links]
            found.append([(info[0], np.array(info[2]), info[1]) for info in infos])
        for (mass, inertia, friction), (heavier, harder, less) in zip(*found, strict=True):
            assert heavier == pytest.approx(1.1 * mass)
            assert harder == pytest.approx(1.1 * inertia)
            assert less == pytest.approx(0.8 * friction) or less == friction
        assert any(less < friction for (_, _, friction), (_, _, less) in zip(*found, strict=True))


def test_a_slippery_robot_slides_down_where_a_normal_one_stands():
    _, x = np.mgrid[0:41, 0:41] * 0.25
    slope = Heightfield((x * math.tan(math.radians(35.0))).astype(np.float32), 0.25, 0.25)
    slid = []
    for friction in (1.0, 0.5):
        with BulletWorld() as world:
            world.add_heightfield(slope)
            robot = WheeledRobot(world, HUSKY, slope.pose_at(5.0, 5.0, math.pi), friction=friction)
            robot.send_command(Twist())
            robot.settle(2.0)
            slid.append(5.0 - robot.pose().x)
    assert slid[0] < 0.5 < 1.0 < slid[1]


def test_a_delayed_command_moves_the_robot_that_much_later():
    moved = []
    for delay in (0.0, 0.05):
        world = KinematicWorld()
        robot = KinematicRobot(world, HUSKY, Pose.planar(0.0, 0.0))
        CommandDelay(world, robot.send_command, delay)(Twist.planar(0.5))
        while robot.velocity().vx == 0.0:
            world.step()
        moved.append(world.time)
    assert moved[1] - moved[0] == pytest.approx(0.05)


def test_noise_of_a_perturbation_adds_to_that_of_the_scenario():
    scenario = load_scenario("indoor").model_copy(
        update={
            "localization": LocalizationNoise(position_noise=0.04, yaw_noise=1.0),
            "perturb": Perturbation(range_noise=0.02, pose_position=0.03, pose_angle=1.0),
        }
    )
    noisy = with_noise(scenario)
    assert noisy.sensors[0].noise == pytest.approx(math.hypot(0.01, 0.02))
    assert noisy.localization.position_noise == pytest.approx(0.05)
    assert noisy.localization.yaw_noise == pytest.approx(math.sqrt(2.0))
    assert (noisy.localization.height_noise, noisy.localization.tilt_noise) == (0.03, 1.0)


def test_the_noise_of_the_localisation_has_the_size_that_the_scenario_says_in_all_six_directions():
    robot = KinematicRobot(KinematicWorld(), TURTLEBOT, Pose.planar(1.0, 2.0, 0.5))
    noise = LocalizationNoise(position_noise=0.03, height_noise=0.02, yaw_noise=2.0, tilt_noise=1.0)
    localization = make_localization(noise, robot, seed=3)
    poses = [localization.measure(0.0) for _ in range(4000)]
    offsets = np.array([pose.position for pose in poses]) - (1.0, 2.0, 0.0)
    assert offsets.mean(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.002)
    assert offsets.std(axis=0) == pytest.approx([0.03, 0.03, 0.02], rel=0.05)
    assert np.degrees(np.std([pose.yaw for pose in poses])) == pytest.approx(2.0, rel=0.05)
    tilts = np.degrees([tilt_of(pose) for pose in poses])
    assert np.sqrt(np.mean(tilts**2)) == pytest.approx(math.sqrt(2.0), rel=0.05)  # roll and pitch together


def test_without_noise_the_localisation_is_the_truth():
    robot = KinematicRobot(KinematicWorld(), TURTLEBOT, Pose.planar(1.0, 2.0, 0.5))
    measured = Localization(robot, np.random.default_rng(0)).measure(0.0)
    assert (measured.position, measured.orientation) == (robot.pose().position, robot.pose().orientation)


def test_noise_of_the_map_changes_the_map_and_not_the_world(tmp_path):
    exact, world = stays("bridge", tmp_path)
    noisy, world_of_noisy_map = stays("bridge", tmp_path, map=MapNoise(height_noise=0.02))
    assert exact != noisy and len(exact) == len(noisy)
    assert np.array_equal(world.ground.vertices, world_of_noisy_map.ground.vertices)


def test_vertices_in_one_place_keep_together_on_a_noisy_map():
    vertices = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 2.0]])
    mapped = MapNoise(height_noise=0.1).on_vertices(vertices, np.random.default_rng(0))
    assert np.array_equal(mapped[0], mapped[2]) and mapped[0, 2] != 1.0
    assert np.array_equal(mapped[:, :2], vertices[:, :2])


def test_a_coarser_map_has_a_quarter_of_the_vertices():
    mapped = MapNoise(spacing=0.5).on_terrain(flat_terrain(20.0, 10.0, 0.25), np.random.default_rng(0))
    assert (mapped.nx, mapped.ny) == (41, 21)


def test_noise_of_cells_turns_over_only_what_lies_along_a_wall():
    occupied = np.zeros((40, 40), dtype=bool)
    occupied[10:20] = True
    grid = OccupancyGrid(occupied, ~occupied, 0.05)
    mapped = MapNoise(cell_noise=0.3).on_grid(grid, np.random.default_rng(0))
    wrong = np.flatnonzero((mapped.occupied != occupied).any(axis=1))
    assert wrong.tolist() == [9, 10, 19, 20]
    assert (mapped.free == ~mapped.occupied).all()
    assert 0.2 < (mapped.occupied != occupied)[9].mean() < 0.4


def test_a_spacing_of_the_map_is_refused_where_the_world_is_no_open_ground(tmp_path):
    text = (shipped_scenarios()["bridge"]).read_text() + "map: {spacing: 0.5}\n"
    (tmp_path / "config").symlink_to(shipped_scenarios()["bridge"].parent / "config")
    (tmp_path / "trial.yaml").write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_scenario(tmp_path / "trial.yaml")
    (finding,) = caught.value.findings
    assert finding.line == len(text.splitlines()) and "bridge" in finding.expected


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_the_seed_changes_something_in_every_shipped_scenario(name, tmp_path):
    """What is drawn: the ground, posts, people, ranges or the pose."""
    scenario = load_scenario(name)
    drawn = {
        "ground": getattr(scenario.world, "median_slope", 0.0) > 0.0,
        "posts": bool(scenario.forests),
        "ranges": any(sensor.noise > 0.0 for sensor in scenario.sensors),
        "pose": scenario.localization.position_noise > 0.0,
    }
    assert any(drawn.values())


def test_two_seeds_drive_differently_on_ground_that_is_not_drawn(tmp_path):
    scenario = load_scenario("bridge").model_copy(update={"time_limit": 2.0})
    digests = [
        run_scenario(scenario, RunOptions(tmp_path / str(number), seed=seed)).metrics["digest"]
        for number, seed in enumerate((1, 1, 2))
    ]
    assert digests[0] == digests[1] != digests[2]
