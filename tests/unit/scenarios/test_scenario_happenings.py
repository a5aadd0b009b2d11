"""Faults, actors, limits and settings of scenarios."""

import math
import re

import numpy as np
import pytest
import yaml

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.sensing import RangeScan
from terrain.physics.actors import RouteWalker, SlidingDoor
from terrain.physics.incidents import IncidentKind
from terrain.physics.kinematic_robot import KinematicRobot
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.people import Person
from terrain.physics.robot_models import TURTLEBOT
from terrain.scenarios.actors import Crowd, Door, OtherRobot, Walker, add_actors
from terrain.scenarios.faults import FaultSchedule, LocalizationJump, SensorFault, seen_from
from terrain.scenarios.limits import Limits, broken_limits
from terrain.scenarios.noise import MapNoise
from terrain.scenarios.scenario import load_scenario
from terrain.scenarios.settings import apply_settings, apply_world_settings
from terrain.scenarios.world import build_world
from terrain.scenarios.world_types import OfficeWorld
from terrain.sensors.proprioception import Localization
from terrain.worlds.map_files import MapFiles


class ClockOnly:
    """The part of a world that a fault schedule uses."""

    def __init__(self):
        self.time = 0.0

    def before_step(self, callback):
        self.step = callback

    def at(self, time):
        self.time = time
        self.step()


@pytest.fixture
def localization():
    world = KinematicWorld()
    return Localization(KinematicRobot(world, TURTLEBOT, Pose.planar(1.0, 2.0)), np.random.default_rng(0))


def test_a_fault_holds_from_its_start_to_just_before_its_end(localization):
    clock = ClockOnly()
    FaultSchedule(clock, {}, localization, [SensorFault(type="silent", sensor="localization", start=1.0, end=2.0)])
    said = []
    for time in (0.0, 1.0, 1.9, 2.0):
        clock.at(time)
        said.append(localization.measure(time) is not None)
    assert said == [True, False, False, True]


def test_two_faults_of_one_sensor_do_not_switch_each_other_off(localization):
    clock = ClockOnly()
    spans = [(1.0, 3.0), (5.0, 6.0)]
    faults = [SensorFault(type="silent", sensor="localization", start=a, end=b) for a, b in spans]
    FaultSchedule(clock, {}, localization, faults)
    clock.at(2.0)
    assert localization.measure(2.0) is None


def test_a_jump_shifts_the_pose_and_ends(localization):
    clock = ClockOnly()
    FaultSchedule(clock, {}, localization, [LocalizationJump(type="jump", dx=0.5, dyaw=0.1, start=1.0, end=2.0)])
    clock.at(1.5)
    jumped = localization.measure(1.5)
    assert (jumped.x, jumped.y) == pytest.approx((1.5, 2.0))
    assert jumped.yaw == pytest.approx(0.1)
    clock.at(2.0)
    assert localization.measure(2.0).x == pytest.approx(1.0)


def test_a_fault_can_be_added_while_the_world_goes_on(localization):
    clock = ClockOnly()
    schedule = FaultSchedule(clock, {}, localization, [])
    assert localization.measure(0.0) is not None
    schedule.add(SensorFault(type="silent", sensor="localization", start=1.0, end=2.0))
    clock.at(1.5)
    assert localization.measure(1.5) is None
    clock.at(2.0)
    assert localization.measure(2.0) is not None


def test_a_fault_of_a_sensor_that_does_not_exist_is_refused_with_the_names_of_those_that_do(localization):
    schedule = FaultSchedule(ClockOnly(), {}, localization, [])
    with pytest.raises(ValueError, match="localization, got 'nose'"):
        schedule.add(SensorFault(type="silent", sensor="nose", start=1.0))


def test_a_scan_turns_and_moves_with_the_estimated_pose():
    scan = RangeScan("lidar", "map", np.array([1.0, 2.0, 0.3]), np.array([[2.0, 2.0, 0.3]]), np.array([True]), 0.0)
    seen = seen_from(scan, Pose.planar(1.0, 2.0), Pose.planar(3.0, 0.0, math.pi / 2))
    assert seen.origin == pytest.approx([3.0, 0.0, 0.3])
    assert seen.ends[0] == pytest.approx([3.0, 1.0, 0.3])


def test_actors_move_in_the_world_and_the_seed_draws_the_crowd(tmp_path):
    actors = (
        Walker(type="walker", route=((4.0, 9.7), (6.0, 9.7)), speed=1.0, blind=True),
        Door(type="door", opened={"x": 9.0, "y": 11.0}, closed={"x": 7.5, "y": 11.0}, closes_at=0.0),
        OtherRobot(type="robot", model="turtlebot", route=((3.0, 9.7), (3.0, 10.7)), speed=0.5),
        Crowd(type="crowd", count=2, x_range=(1.0, 10.0), y_range=(8.6, 10.9)),
    )
    places = []
    for seed in (1, 1, 2):
        rng = np.random.default_rng(0)
        world = build_world(OfficeWorld(type="office"), MapFiles(tmp_path, MapNoise(), rng), rng, np.zeros((0, 2)))
        before = world.physics.bullet.getNumBodies()
        add_actors(world, actors, np.random.default_rng(seed))
        for _ in range(240):
            world.physics.step()
        bodies = range(before, before + 5)
        places.append([world.physics.bullet.getBasePositionAndOrientation(b)[0] for b in bodies])
        world.physics.close()
    assert places[0][0] == pytest.approx((5.0, 9.7, 0.85), abs=0.02)
    assert places[0][1] == pytest.approx((8.25, 11.0, 1.0), abs=0.02)
    assert places[0][2] == pytest.approx((3.0, 10.2, 0.205), abs=0.02)
    assert places[0] == places[1]
    assert places[0][3:] != places[2][3:]
    assert [actor.thing.value for actor in world.actors] == ["person", "door", "robot", "person", "person"]
    assert [type(actor) for actor in world.actors] == [RouteWalker, SlidingDoor, RouteWalker, Person, Person]


def test_each_broken_limit_is_named():
    limits = Limits(max_tilt=20.0, max_path_length=50.0, forbidden=(IncidentKind.COLLISION,))
    metrics = {"max_tilt_deg": 25.0, "path_length_m": 40.0, "incidents": ["collision", "slipping"]}
    assert broken_limits(limits, metrics) == ["max_tilt_deg 25.0 is above 20 degrees", "collision happened"]
    assert broken_limits(Limits(), metrics) == []


CONFIG = """
planners:
  - {name: fast, type: dijkstra}
  - {name: smooth, type: cvp}
mesh_map: {edge_cost_factor: 1.0}
"""


@pytest.mark.parametrize(
    ("planner", "first", "count"),
    [
        ("smooth", "cvp", 2),
        ("cvp", "cvp", 2),
        ("dijkstra", "dijkstra", 2),
        ("astar", "astar", 3),
        ("a.b:C", "a.b:C", 3),
    ],
)
def test_the_planner_of_a_setting_becomes_the_default(planner, first, count):
    planners = yaml.safe_load(apply_settings(CONFIG, {"planner": planner}))["planners"]
    assert planners[0]["type"] == first
    assert len(planners) == count


def test_a_dotted_setting_changes_one_value_with_its_type():
    changed = yaml.safe_load(apply_settings(CONFIG, {"mesh_map.edge_cost_factor": "2.5", "oscillation.timeout": "3"}))
    assert changed["mesh_map"] == {"edge_cost_factor": 2.5}
    assert changed["oscillation"] == {"timeout": 3}


def test_a_dotted_setting_through_a_value_is_refused():
    with pytest.raises(ConfigError, match="block of keys"):
        apply_settings(CONFIG, {"mesh_map.edge_cost_factor.x": "2"})


@pytest.mark.parametrize("key", ["time_limit", "robot", "limits.max_tilt"])
def test_a_setting_of_a_key_of_the_scenario_is_refused_as_one(key):
    with pytest.raises(ConfigError, match=f"setting {key}:1: .* a key of the scenario: change it in its file"):
        apply_settings(CONFIG, {key: "30"})


def test_a_setting_of_the_world_changes_the_ground_and_is_no_setting_of_the_navigation():
    scenario, rest = apply_world_settings(load_scenario("outdoor"), {"world.size": "40.0", "planner": "cvp"})
    assert (scenario.world.size, rest) == (40.0, {"planner": "cvp"})
    assert apply_world_settings(scenario, rest) == (scenario, rest)


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("world.size", "-3.0", "expected a number > 1 and <= 1000 m, got -3.0"),
        ("world.siz", "3.0", "expected a known key, got 'siz' (did you mean 'size'?)"),
    ],
)
def test_a_wrong_setting_of_the_world_is_refused_by_name(key, value, text):
    with pytest.raises(ConfigError, match=re.escape(f"settings:1: {key}: {text}")):
        apply_world_settings(load_scenario("outdoor"), {key: value})


def test_no_settings_leave_the_text_as_it_is():
    assert apply_settings(CONFIG, {}) == CONFIG
