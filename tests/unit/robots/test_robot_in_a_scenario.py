"""A URDF in a scenario: read, checked, handed to the configuration, and driven with and without physics."""

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from mbf_abstract.cli import make_app
from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import AckermannCommand, Pose, Twist
from mbf_abstract.server.factory import read_config
from terrain.description.parameters import UrdfRobot
from terrain.description.placeholders import fill_in, robot_values
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.robot_models import HUSKY, Drive
from terrain.physics.robots import WheeledRobot
from terrain.physics.world import BulletWorld
from terrain.scenarios.on_map import MARGIN
from terrain.scenarios.scenario import load_scenario
from terrain.session.runner import RunOptions, run_scenario
from terrain.urdf_robots.omni_robot import OmniRobot
from terrain.urdf_robots.robot_choice import description_of, simulated_spec, spec_of
from tests.unit.robots.conftest import BODY, FIXED_AXLE, FOUR_WHEELS, KIWI, link, package_file, robot, steered

EXAMPLES = KIWI.parent
SCENARIO = """
name: mine
proves: My robot drives.
backend: costmap
navigation: {costmap: nav.yaml}
world: {type: generated, size: [12.0, 8.0], spacing: 0.5}
start: {x: 3.0, y: 4.0}
goals: [{x: 7.0, y: 4.0}]
time_limit: 30.0
"""
NAVIGATION = """
backend: costmap
max_vel_x: $ROBOT_MAX_SPEED
dist_tolerance: 0.3
angle_tolerance: 3.0
planners: [{name: astar, type: astar}]
controllers: [{name: pursuit, type: regulated_pure_pursuit}]
global_costmap: &map
  footprint: $ROBOT_FOOTPRINT
  layers: [{name: slopes, type: static}]
  slopes: {map_file: $WORLD_MAP}
local_costmap: *map
"""
ON_A_MESH = """
backend: mesh
planners: [{name: dijkstra, type: mesh.dijkstra}]
controllers: [{name: follow, type: mesh.path_follower}]
mesh_map: {mesh_file: $WORLD_MESH}
"""


@pytest.fixture
def scenario(tmp_path):
    """Write a scenario with a robot of its own and return its file."""

    def write(robot_text, urdf=None, **changes):
        (tmp_path / "my.urdf").write_text(urdf or robot(BODY, *FOUR_WHEELS))
        (tmp_path / "nav.yaml").write_text(NAVIGATION)
        data = yaml.safe_load(SCENARIO) | {"robot": yaml.safe_load(robot_text)} | changes
        file = tmp_path / "mine.yaml"
        file.write_text(yaml.safe_dump(data))
        return file

    return write


@pytest.mark.parametrize("text", ["my.urdf", "{urdf: my.urdf}"])
def test_a_text_and_a_block_name_the_same_robot_beside_the_scenario(scenario, tmp_path, text):
    loaded = load_scenario(scenario(text))
    assert loaded.robot == UrdfRobot(urdf=str(tmp_path / "my.urdf"))
    assert spec_of(loaded.robot).circumscribed_radius + MARGIN == pytest.approx(np.hypot(0.5, 0.4) + 0.15)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("huskey", "robot: expected husky, turtlebot, car, a file .urdf, or a block"),
        ("gone.urdf", "robot: expected a URDF, got 'gone.urdf'"),
        ("{urdf: my.urdf, drive: hover}", "robot.drive: expected 'differential'"),
        (
            "{urdf: my.urdf, center_of_mass: [0.0, 0.0, 0.0]}",
            "robot.center_of_mass: expected x, y, z [m] with z above 0",
        ),
        ("{urdf: my.urdf, max_sped: 1.0}", "did you mean 'max_speed'?"),
        ("{urdf: my.urdf, wheels: [front_lefd]}", "did you mean 'front_left'?"),
        ("{urdf: my.urdf, drive: ackermann}", "expected one steered wheel, or two beside each other"),
        ("{drive: skid}", "robot.urdf: expected a value, got nothing"),
        ("{urdf: my.urdf, drive: legged}", "physics: expected kinematic, for a robot on legs"),
    ],
)
def test_what_is_wrong_with_a_robot_is_a_finding_of_its_scenario(scenario, text, expected):
    with pytest.raises(ConfigError) as caught:
        load_scenario(scenario(text))
    assert expected in str(caught.value)
    assert len(caught.value.findings) == 1


def test_placeholders_stand_for_the_numbers_of_the_robot(described):
    found = described(robot(BODY, *FOUR_WHEELS))
    text = fill_in("a: $ROBOT_TRACK\nb: $ROBOT_FOOTPRINT\nc: $ROBOT_MAX_TILT\n", "nav.yaml", lambda: found)
    values = yaml.safe_load(text)
    assert (values["a"], [tuple(corner) for corner in values["b"]]) == (0.7, found.footprint)
    assert values["c"] == pytest.approx(0.5 * (0.45 + found.tipping.least), abs=1e-4)


def test_a_slope_that_the_robot_cannot_take_is_refused_where_it_is_asked_for(described):
    found = described(robot(BODY, *FOUR_WHEELS), center_of_mass=(-0.298, 0.0, 0.2))
    with pytest.raises(ConfigError) as caught:
        fill_in("tilt:\n  max_roll: $ROBOT_MAX_ROLL\n  max_pitch_up: $ROBOT_MAX_PITCH_UP\n", "nav.yaml", lambda: found)
    assert str(caught.value) == (
        "nav.yaml:3: expected a slope above 0 (hand_made tips over at 1 degrees, tip_over_margin is 9 degrees; "
        "is its center_of_mass right?), got $ROBOT_MAX_PITCH_UP, 0"
    )


def test_limits_of_slope_keep_a_margin_to_where_the_robot_tips_over(described):
    high = described(robot(BODY, *FOUR_WHEELS), center_of_mass=(0.0, 0.0, 1.0), tip_over_margin=0.1)
    values = robot_values(high)
    assert float(values["$ROBOT_MAX_PITCH_UP"]) == pytest.approx(high.tipping.backward - 0.1, abs=1e-4)
    assert float(values["$ROBOT_MAX_ROLL"]) == pytest.approx(high.tipping.left - 0.1, abs=1e-4)
    assert float(values["$ROBOT_CENTER_OF_MASS_HEIGHT"]) == 1.0


def test_a_placeholder_that_is_misspelt_or_has_no_number_is_an_error_with_its_line(described):
    found = described(robot(BODY, *FOUR_WHEELS))
    with pytest.raises(ConfigError, match=r"nav.yaml:2: expected a number.*got \$ROBOT_TRAK \(did you mean"):
        fill_in("a: 1\nb: $ROBOT_TRAK\n", "nav.yaml", lambda: found)
    legged = description_of(package_file("a1/a1.urdf"))
    with pytest.raises(ConfigError, match=r"nav.yaml:1: .*a1_description \(legged\)"):
        fill_in("a: $ROBOT_WHEELBASE\n", "nav.yaml", lambda: legged)


def test_a_configuration_without_placeholders_asks_nothing_of_a_robot():
    assert fill_in("a: $WORLD_MESH\n", "nav.yaml", lambda: pytest.fail("described")) == "a: $WORLD_MESH\n"


@pytest.mark.parametrize("name", ["husky", "turtlebot", "car"])
def test_robots_that_ship_have_every_number_that_the_tilt_layer_takes(name):
    values = robot_values(description_of(name))
    assert {"$ROBOT_WHEELBASE", "$ROBOT_TRACK", "$ROBOT_GROUND_CLEARANCE", "$ROBOT_MAX_TILT"} <= values.keys()
    if name == "husky":
        assert float(values["$ROBOT_WHEELBASE"]) == HUSKY.wheelbase
        assert yaml.safe_load(values["$ROBOT_FOOTPRINT"]) == [list(corner) for corner in HUSKY.footprint]


def on_flat_ground(choice, folder, kind=WheeledRobot):
    """A world, and a robot that has settled in it."""
    world = BulletWorld()
    world.add_ground_plane(-5.0, 5.0, -5.0, 5.0)
    made = kind(world, simulated_spec(choice, folder, "robot"), Pose.planar(0.0, 0.0))
    made.settle()
    return world, made


def driven(world, made, command, seconds=2.0):
    """Velocity of the base after driving for a while."""
    for _ in range(round(seconds / world.time_step)):
        made.send_command(command)
        world.step()
    return made.velocity()


@pytest.mark.parametrize("name", ["husky/husky.urdf", "racecar/racecar.urdf"])
def test_a_robot_of_others_stands_on_its_wheels_weighs_what_it_should_and_drives_ahead(tmp_path, name):
    choice = package_file(name).model_copy(update={"max_speed": 1.0})
    world, made = on_flat_ground(choice, tmp_path)
    with world:
        assert abs(made.pose().z) < 0.003
        masses = [made._bullet.getDynamicsInfo(made.body, link)[0] for link in (-1, *made._joints.values())]
        assert sum(masses) == pytest.approx(description_of(choice).mass, rel=1e-6)
        assert driven(world, made, Twist.planar(0.8)).vx == pytest.approx(0.8, abs=0.03)
        assert made.motion_sample().rolling.vx == pytest.approx(0.8, abs=0.03)


def test_a_robot_stands_on_the_ground_with_a_stated_wheel_radius(scenario, tmp_path):
    scenario("my.urdf")
    choice = UrdfRobot(urdf=str(tmp_path / "my.urdf"), wheel_radius=0.25)
    world, made = on_flat_ground(choice, tmp_path)
    with world:
        assert abs(made.pose().z) < 0.003


def test_the_centre_of_mass_in_bullet_is_that_of_the_description(tmp_path):
    choice = package_file("husky/husky.urdf")
    world, made = on_flat_ground(choice, tmp_path)
    with world:
        total, moment = 0.0, np.zeros(3)
        for link in (-1, *made._joints.values()):
            mass = made._bullet.getDynamicsInfo(made.body, link)[0]
            state = (
                made._bullet.getBasePositionAndOrientation(made.body)
                if link < 0
                else made._bullet.getLinkState(made.body, link)
            )
            total, moment = total + mass, moment + mass * np.array(state[0])
        pose = made.pose()
        in_base = pose.rotation.T @ (moment / total - np.array(pose.position))
    assert in_base == pytest.approx(description_of(choice).center_of_mass, abs=1e-4)


def test_a_car_of_others_turns_on_the_circle_of_its_steering(tmp_path):
    choice = package_file("racecar/racecar.urdf").model_copy(update={"max_speed": 1.0})
    world, made = on_flat_ground(choice, tmp_path)
    with world:
        velocity = driven(world, made, AckermannCommand(0.5, 0.3))
    assert velocity.wz / velocity.vx == pytest.approx(np.tan(0.3) / 0.325, rel=0.05)


@pytest.mark.parametrize("x", [0.5, -0.5])  # a tricycle; a forklift
@pytest.mark.parametrize("ys", [[0.0], [0.35, -0.35]])
def test_steered_wheels_ahead_or_behind_one_or_two_turn_a_robot_as_commanded(write, tmp_path, x, ys):
    wheels = [part for k, y in enumerate(ys) for part in steered(f"steered_{k}", x, y)]
    text = robot(BODY, *FIXED_AXLE, *wheels).replace('mass value="6.0"', 'mass value="30.0"')
    choice = UrdfRobot(urdf=str(write(text)), max_speed=1.0, center_of_mass=(0.5 * x, 0.0, 0.2))
    world, made = on_flat_ground(choice, tmp_path)
    with world:
        velocity = driven(world, made, Twist.planar(0.5, 0.0, 0.3))
        believed = made.rolling_velocity()
    assert velocity.wz / velocity.vx == pytest.approx(0.6, rel=0.07)
    assert believed.wz / believed.vx == pytest.approx(0.6, rel=0.01)


def test_an_omnidirectional_robot_moves_sideways_and_turns_as_commanded(tmp_path):
    world, made = on_flat_ground(UrdfRobot(urdf=str(KIWI)), tmp_path, OmniRobot)
    with world:
        velocity = driven(world, made, Twist((0.3, 0.4, 0.0), (0.0, 0.0, 0.5)))
        assert (velocity.vx, velocity.vy, velocity.wz) == pytest.approx((0.3, 0.4, 0.5), abs=0.02)
        stopped = driven(world, made, Twist())
        assert abs(stopped.vx) + abs(stopped.vy) + abs(stopped.wz) < 0.01


def test_without_physics_a_robot_on_legs_moves_sideways():
    spec = spec_of(package_file("a1/a1.urdf"))
    assert spec.drive is Drive.HOLONOMIC
    world = KinematicWorld()
    made = KinematicRobot(world, spec, Pose.planar(0.0, 0.0, np.pi / 2))
    velocity = driven(world, made, Twist((0.0, 0.5, 0.0), (0.0, 0.0, 0.0)))
    assert velocity.vy == pytest.approx(0.5)
    assert made.pose().x < -0.7 and abs(made.pose().y) < 1e-6


def test_a_robot_of_ones_own_arrives_and_its_run_can_be_read(scenario, tmp_path):
    result = run_scenario(load_scenario(scenario("my.urdf")), RunOptions(tmp_path / "run"))
    assert result.success, str(result.verdict)
    assert (tmp_path / "run" / "robot.urdf").is_file()
    _, checked = read_config(tmp_path / "run" / "navigation.yaml")
    assert checked.backend == "costmap"


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_example_can_be_read_and_its_configuration_is_complete(file):
    loaded = load_scenario(file)
    for source in loaded.navigation.values():
        filled = fill_in(source.read_text(), str(source), lambda: description_of(loaded.robot))
        assert "$ROBOT" not in filled
        assert yaml.safe_load(filled)["backend"] == loaded.backend


def checked(file, *options):
    return CliRunner().invoke(make_app(), ["check", str(file), *options])


def test_mbf_check_of_a_scenario_names_what_was_assumed_of_its_robot(scenario):
    shown = checked(scenario("my.urdf"))
    assert shown.exit_code == 0, shown.output
    assert "hand_made: skid (2 wheels on the left" in shown.output
    assert "max_speed: 1 m/s is assumed" in shown.output


def test_mbf_check_names_what_was_assumed_also_where_something_is_wrong(scenario, tmp_path):
    file = scenario("my.urdf")
    (tmp_path / "nav.yaml").write_text(NAVIGATION + "controller_frequency: 0\n")
    shown = checked(file)
    assert shown.exit_code == 2
    assert "note: hand_made: max_speed: 1 m/s is assumed" in shown.output
    assert "controller_frequency: expected a number > 0" in shown.output


def test_mbf_check_names_controllers_that_a_car_cannot_do(scenario, tmp_path):
    file = scenario("{urdf: 'package://pybullet_data/racecar/racecar.urdf'}")
    (tmp_path / "nav.yaml").write_text(NAVIGATION.replace("regulated_pure_pursuit", "rotation_shim"))
    checked = CliRunner().invoke(make_app(), ["check", str(file)])
    assert checked.exit_code == 0, checked.output
    told = " ".join(checked.output.split())
    assert "controller 'pursuit' turns on the spot, which the robot cannot: its tightest curve is" in told
    assert "m; costmap.regulated_pure_pursuit or costmap.mppi with motion_model: ackermann suits it" in told


def test_mbf_check_names_controllers_of_a_mesh_that_a_car_cannot_do(scenario, tmp_path):
    file = scenario(
        "{urdf: 'package://pybullet_data/racecar/racecar.urdf'}", backend="mesh", navigation={"mesh": "nav.yaml"}
    )
    (tmp_path / "nav.yaml").write_text(ON_A_MESH)
    told = " ".join(checked(file).output.split())
    assert "controller 'follow' turns on the spot, which the robot cannot: its tightest curve is" in told
    assert "m; mesh.mppi with motion_model: ackermann suits it" in told


def test_mbf_check_lists_mistakes_of_the_urdf_and_of_the_scenario_together(scenario):
    shown = checked(scenario("my.urdf", urdf=robot(BODY, *FOUR_WHEELS, link("body")), goals=[], time_limit=20.0))
    assert shown.exit_code == 2
    assert "goals: expected at least one goal" in shown.output
    assert "my.urdf:1: link: expected a name of its own, got 'body' twice" in shown.output
    assert "2 mistakes found" in shown.output


def test_mbf_check_of_a_configuration_with_numbers_of_a_robot_takes_a_husky(scenario, tmp_path):
    scenario("my.urdf")
    assert "a Husky on level ground stands in" in checked(tmp_path / "nav.yaml").output
    (tmp_path / "nav.yaml").write_text(NAVIGATION.replace("$ROBOT_MAX_SPEED", "$ROBOT_MAX_SPED"))
    shown = checked(tmp_path / "nav.yaml")
    assert shown.exit_code == 2
    assert "nav.yaml:3: expected a number" in shown.output


def test_several_robots_may_each_have_a_urdf_of_their_own(scenario, tmp_path):
    file = scenario(
        "husky",
        robots=[
            {"name": "mine", "robot": "my.urdf", "start": {"x": 3.0, "y": 2.5}, "goals": [{"x": 6.0, "y": 2.5}]},
            {"name": "other", "start": {"x": 3.0, "y": 5.5}, "goals": [{"x": 6.0, "y": 5.5}]},
        ],
    )
    data = {key: value for key, value in yaml.safe_load(file.read_text()).items() if key not in ("start", "goals")}
    file.write_text(yaml.safe_dump(data))
    loaded = load_scenario(file)
    assert loaded.robots[0].robot == UrdfRobot(urdf=str(tmp_path / "my.urdf"))
    result = run_scenario(loaded, RunOptions(tmp_path / "run"))
    assert result.success, str(result.verdict)
    assert (tmp_path / "run" / "mine.urdf").is_file()
