"""``robots`` of a scenario: what is legal, and what each robot gets of the scenario and of the world."""

import itertools
import tempfile

import numpy as np
import pytest

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.config.yaml_source import load_yaml
from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import MoveBaseGoal
from terrain.physics.actors import Fellow
from terrain.physics.contact_depth import placed
from terrain.physics.encounters import Mover
from terrain.physics.incidents import Incident, IncidentKind
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.motion_sample import Other, Thing
from terrain.physics.robot_models import CAR, HUSKY, TURTLEBOT
from terrain.physics.robots import WheeledRobot
from terrain.physics.simulation import Simulation
from terrain.physics.world import BulletWorld
from terrain.recording.fleet_metrics import contacts_between, judge_together
from terrain.recording.verdict import Level, Verdict
from terrain.scenarios.library import shipped_scenarios
from terrain.scenarios.on_map import on_map
from terrain.scenarios.scenario import load_scenario, robot_scenarios
from terrain.sensors.rays import FellowRays
from terrain.session.fleet import FleetSession, seed_of
from terrain.session.fleet_run import run_fleet
from terrain.session.robot_run import RunLogs
from terrain.session.run_options import RunOptions
from terrain.session.scenario_check import check_scenario
from terrain.session.session import Session
from terrain.sweeps.sweep import hash_of

PAIR = """
name: pair
proves: Nothing.
backend: mesh
navigation: {mesh: nav.yaml}
world: {type: office}
robot: turtlebot
robots:
  - {name: anna, start: {x: 3.0, y: 9.7}, goals: [{x: 9.0, y: 9.7}]}
  - {name: ben, start: {x: 9.0, y: 9.7}, goals: [kitchen, reception], robot: husky, sensors: [{name: camera}]}
sensors: [{name: lidar}]
physics: kinematic
"""
ALONE = "start: {x: 1.0, y: 9.7}\n"


def pair(folder, text=PAIR):
    (folder / "nav.yaml").write_text("backend: mesh\n")
    (folder / "pair.yaml").write_text(text)
    return load_scenario(folder / "pair.yaml")


def findings(folder, text):
    with pytest.raises(ConfigError) as caught:
        pair(folder, text)
    return {finding.key: finding for finding in caught.value.findings}


def test_each_robot_drives_the_scenario_with_its_own_values_in_place_of_it(tmp_path):
    anna, ben = robot_scenarios(pair(tmp_path)).values()
    assert (anna.name, anna.robot, anna.goals[0].x, anna.sensors[0].name) == ("pair/anna", "turtlebot", 9.0, "lidar")
    assert (ben.name, ben.robot, ben.goals, ben.sensors[0].name) == (
        "pair/ben",
        "husky",
        ("kitchen", "reception"),
        "camera",
    )
    assert anna.robots == ben.robots == ()
    assert ben.navigation == anna.navigation


def test_each_robot_may_have_noise_and_late_commands_of_its_own(tmp_path):
    own = "robot: husky, odometry: wheels, localization: {yaw_noise: 2.0}, perturb: {command_delay: 0.1}"
    text = PAIR.replace("robot: husky", own) + "perturb: {command_delay: 0.2}\n"
    anna, ben = robot_scenarios(pair(tmp_path, text)).values()
    assert (anna.odometry, anna.localization.yaw_noise, anna.perturb.command_delay) == ("exact", 0.0, 0.2)
    assert (ben.odometry, ben.localization.yaw_noise, ben.perturb.command_delay) == ("wheels", 2.0, 0.1)


def test_a_scenario_without_robots_is_that_of_its_only_robot():
    indoor = load_scenario("indoor")
    assert robot_scenarios(indoor) == {"": indoor}


@pytest.mark.parametrize(
    ("old", "new", "key", "expected"),
    [
        ("name: ben", "name: anna", "robots[1].name", "a name of its own"),
        ("name: ben", "name: ../ben", "robots[1].name", "a letter, then letters, digits and _"),
        ("goals: [kitchen, reception]", "goals: []", "robots[1].goals", "at least one goal"),
        ("start: {x: 3.0, y: 9.7}, ", "", "robots[0].start", "a value"),
        ("robot: husky", "model: husky", "robots[1].model", "a known key"),
        ("robot: husky", "backend: costmap", "robots[1].backend", "a backend listed under navigation (mesh)"),
        ("robot: husky", "navigation: {mesh: none.yaml}", "robots[1].navigation.mesh", "a configuration file"),
        ("physics: kinematic", ALONE, "start", "nothing beside robots, which have their own"),
        (
            "physics: kinematic",
            "faults: [{type: silent, sensor: lidar, start: 1.0}]",
            "faults[0].sensor",
            "one of camera",
        ),
    ],
)
def test_a_mistake_is_reported_where_it_stands(tmp_path, old, new, key, expected):
    found = findings(tmp_path, PAIR.replace(old, new))
    assert list(found) == [key]
    assert expected in found[key].expected
    assert found[key].line > 1


def test_a_scenario_needs_a_start_and_goals_or_robots(tmp_path):
    text = PAIR[: PAIR.index("robots:")] + PAIR[PAIR.index("sensors: [{name: lidar}]") :]
    assert {key: finding.got for key, finding in findings(tmp_path, text).items()} == {
        "start": "nothing",
        "goals": "none",
    }


def test_two_robots_in_one_place_are_refused_by_name(tmp_path):
    scenario = pair(tmp_path, PAIR.replace("start: {x: 9.0, y: 9.7}", "start: {x: 3.5, y: 9.7}"))
    with pytest.raises(ConfigError, match=r"robots\[1\]\.start: expected a place that 'anna' does not stand in"):
        FleetSession(scenario)


def test_a_run_whose_executive_is_unknown_closes_what_it_has_opened(tmp_path, monkeypatch):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    with pytest.raises(ConfigError, match="executive"):
        run_fleet(load_scenario("two_couriers"), RunOptions(tmp_path / "run", executive="nobody"))
    assert list(temporary.iterdir()) == []


def test_a_run_that_is_refused_closes_the_logs_of_all_robots(tmp_path, monkeypatch):
    made = []

    class NotedLogs(RunLogs):
        def __init__(self, folder):
            super().__init__(folder)
            made.append(self)

    monkeypatch.setattr("terrain.session.fleet_run.RunLogs", NotedLogs)
    scenario = pair(tmp_path, PAIR.replace("start: {x: 9.0, y: 9.7}", "start: {x: 3.5, y: 9.7}"))
    with pytest.raises(ConfigError, match="does not stand in"):
        run_fleet(scenario, RunOptions(tmp_path / "run"))
    assert len(made) == 2
    for logs in made:
        with pytest.raises(OSError, match="closed"):
            logs.sinks[0].write(Event(0.0, EventKind.FAULT, "robot", {}))


def test_a_session_of_one_robot_and_another_map_refuse_several_robots(tmp_path):
    scenario = pair(tmp_path)
    with pytest.raises(ConfigError, match="FleetSession"):
        Session(scenario)
    with pytest.raises(ConfigError, match="one robot"):
        on_map(scenario, tmp_path / "map.yaml")


def test_each_robot_draws_from_a_seed_that_no_other_robot_changes():
    seeds = {seed_of(seed, name) for seed, name in itertools.product(range(20), ("anna", "ben", "carla"))}
    assert len(seeds) == 60
    assert seed_of(3, "anna") == 4076182031, "runs of before would not repeat"


def test_the_configuration_of_one_robot_counts_in_the_hash_of_a_sweep(tmp_path):
    text = PAIR.replace("robot: husky", "navigation: {mesh: own.yaml}")
    (tmp_path / "own.yaml").write_text("backend: mesh\n")
    before = hash_of(pair(tmp_path, text))
    (tmp_path / "own.yaml").write_text("backend: mesh\ncontroller_frequency: 10.0\n")
    assert hash_of(pair(tmp_path, text)) != before


def test_the_check_of_a_scenario_looks_for_the_places_and_the_configurations_of_each_robot(tmp_path):
    text = PAIR.replace("robot: husky", "navigation: {mesh: own.yaml}").replace("kitchen", "canteen")
    (tmp_path / "own.yaml").write_text("backend: meshes\n")
    (tmp_path / "nav.yaml").write_text("backend: mesh\n")
    (tmp_path / "pair.yaml").write_text(text)
    found = check_scenario(load_yaml(tmp_path / "pair.yaml")).findings
    assert any(finding.key == "robots[1].goals[0]" and "canteen" in finding.got for finding in found)
    assert any(finding.file.endswith("own.yaml") for finding in found)


def test_a_scenario_with_robots_ships():
    assert any(load_scenario(name).robots for name in shipped_scenarios())


# ------------------------------------------------------------------------------------------------ in one world
def two_kinematic():
    world = KinematicWorld()
    left = KinematicRobot(world, TURTLEBOT, Pose.planar(0.0, 0.0))
    right = KinematicRobot(world, TURTLEBOT, Pose.planar(1.5, 0.0, np.pi))
    left.fellows, right.fellows = [Fellow(right)], [Fellow(left)]
    return world, left, right


def two_wheeled():
    world = BulletWorld()
    world.add_ground_plane(-5.0, 5.0, -5.0, 5.0)
    left, right = (
        WheeledRobot(world, TURTLEBOT, pose) for pose in (Pose.planar(0.0, 0.0), Pose.planar(1.5, 0.0, np.pi))
    )
    left.settle()
    world.things |= {left.body: Thing.ROBOT, right.body: Thing.ROBOT}
    return world, left, right


@pytest.mark.parametrize("make", [two_kinematic, two_wheeled])
def test_who_drives_into_a_robot_that_stands_has_moved_and_the_other_has_not(make):
    world, left, right = make()
    with world:
        simulations = {
            "left": Simulation(world, left, fellows={"right": Fellow(right)}),
            "right": Simulation(world, right, fellows={"left": Fellow(left)}),
        }
        for step in range(60):
            left.send_command(Twist.planar(0.4))
            simulations["left"].advance_to(0.1 * step)

        assert right.pose().x - left.pose().x > 0.2  # neither drives through the other
        assert simulations["right"].monitor.distance == pytest.approx(abs(1.5 - right.pose().x), abs=0.05)
        (contact,) = contacts_between({name: simulation.incidents for name, simulation in simulations.items()})
        assert (contact["robots"], contact["moved"]) == (["left", "right"], ["left"])
        assert simulations["left"].monitor.counts[IncidentKind.COLLISION_WHILE_MOVING] == 1
        assert simulations["right"].monitor.counts[IncidentKind.COLLISION_WHILE_MOVING] == 0


@pytest.mark.parametrize("spec", [TURTLEBOT, HUSKY, CAR])
def test_a_lidar_sees_another_robot_where_its_outline_is(spec):
    robot = KinematicRobot(KinematicWorld(), spec, Pose.planar(2.0, 0.5, 0.7))
    angles = np.linspace(-np.pi, np.pi, 720)
    directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(720)])
    origins = np.tile([2.0 - 4.0, 0.5, 0.5 * spec.height], (720, 1))

    distances = FellowRays([Fellow(robot)]).distances(origins, directions, 10.0)

    seen = np.isfinite(distances)
    hits = (origins[seen] + distances[seen, None] * directions[seen])[:, :2]
    corners = placed(spec.footprint_array(), 2.0, 0.5, 0.7)
    along = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    beyond = np.sum((hits[:, None] - corners) * outward, axis=2).max(axis=1)
    assert len(hits) > 5
    assert np.abs(beyond).max() < 0.02


def test_each_robot_of_a_fleet_hears_where_the_others_are_and_where_they_go():
    with FleetSession("two_couriers") as fleet:
        anna = fleet.sessions["anna"]
        anna.navigator.send(MoveBaseGoal(anna.goals[0]))
        fleet.clock.sleep(2.0)
        heard = {
            name: {one.name: one for one in session.navigator.server.runtime.traffic.others(fleet.clock.now())}
            for name, session in fleet.sessions.items()
        }
        place = anna.robot.pose()
    assert {name: list(others) for name, others in heard.items()} == {"anna": ["ben"], "ben": ["anna"]}
    assert heard["ben"]["anna"].remaining == pytest.approx(7.5, abs=1.5)
    assert np.hypot(*(heard["ben"]["anna"].path[0, :2] - (place.x, place.y))) < 0.5
    assert (heard["anna"]["ben"].remaining, len(heard["anna"]["ben"].path)) == (0.0, 1)


# ------------------------------------------------------------------------------------------------- the judgement
def contact(stamp, other, moved):
    who = Other(other, Thing.ROBOT, 0.0, 0.0)
    return Incident(IncidentKind.COLLISION_WITH_ROBOT, stamp, Pose.planar(0.0, 0.0), 0.3, moved, who)


def test_a_contact_that_both_robots_report_counts_once_with_all_that_moved():
    found = contacts_between(
        {
            "ben": [contact(4.0, "anna", Mover.ROBOT), contact(9.0, "anna", Mover.NEITHER)],
            "anna": [contact(4.05, "ben", Mover.ROBOT), contact(5.0, "robot 1", Mover.ROBOT)],
        }
    )
    assert found == [
        {"time": 4.0, "robots": ["anna", "ben"], "moved": ["anna", "ben"]},
        {"time": 9.0, "robots": ["anna", "ben"], "moved": []},
    ]


def test_the_run_is_as_good_as_its_worst_robot():
    good, lost = Verdict(0, "goal reached"), Verdict(56, "no path found")
    touched, missed = (
        Verdict(0, "goal reached", ("a contact",)),
        Verdict(0, "goal reached", ("missed",), at_goals=False),
    )

    def level(*verdicts):
        return judge_together(dict(zip("abc", verdicts, strict=False))).level

    assert level(good, good) is Level.SUCCESS
    assert level(good, touched) is Level.ARRIVED
    assert level(touched, missed) is level(good, lost) is Level.FAILED
    joint = judge_together({"anna": good, "ben": lost, "carla": touched})
    assert (joint.outcome, joint.failures) == (56, ("carla: a contact",))
    assert "1 of 3 robots succeeded" in joint.message and "ben: no path found" in joint.message
