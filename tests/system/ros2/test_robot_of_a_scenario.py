"""Our node drives the robot of a scenario over ROS 2 to a goal that a client sends, in lockstep unless said otherwise.

Indoors on a costmap, without physics; outdoors on the mesh of real hills, with Bullet.
"""

import json
import re
import time
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest
import yaml

import terrain.scenarios.scenario
from mbf_abstract.outcomes import MoveBaseOutcome
from tests.system.ros2.conftest import BRIEF_LEASE, PEERS, WITHIN, Client, Peer
from tests.system.ros2.environments import free_domain

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
LIBRARY = Path(terrain.scenarios.scenario.__file__).parent / "library"
INDOOR = f"""
name: to_the_door
proves: A robot of ours is driven over ROS 2.
backend: costmap
navigation: {{costmap: {LIBRARY}/config/indoor_costmap.yaml}}
physics: kinematic
world: {{type: office}}
robot: turtlebot
start: {{x: 3.0, y: 3.0, yaw: 0.0}}
goals: [{{x: 4.0, y: 3.0, yaw: 0.0}}]
sensors: [{{name: lidar, type: planar, rate: 10.0, rays: 90, max_range: 8.0}}]
"""
FARTHER = INDOOR.replace("goals: [{x: 4.0", "goals: [{x: 7.0")
COMMAND_TIMEOUT, STEP = 0.5, 1.0 / 60.0  # s; of the configuration of that run


def outdoor():
    """The scenario that ships, on a smaller piece of ground, with a goal two metres from its start."""
    scenario = yaml.safe_load((LIBRARY / "outdoor.yaml").read_text("utf-8"))
    scenario["navigation"] = {name: f"{LIBRARY}/{file}" for name, file in scenario["navigation"].items()}
    scenario["world"] |= {"size": 16.0, "spacing": 0.25}  # m; points as far apart as at the full size of 100 m
    scenario["goals"] = [{"x": 9.4, "y": 9.4, "yaw": 0.8}]
    return yaml.safe_dump(scenario)


class DrivenWorld:
    """``mbf run SCENARIO --ros2``, our node with the configuration of that run, and a client."""

    def __init__(self, closing, folder, logs, scenario, *sensors, lockstep=True):
        self._closing, self._folder, self._logs = closing, folder, logs
        self._domain = free_domain(folder.parent, closing)
        self.run, self._sensors = logs / "run", sensors
        file = logs / "scenario.yaml"
        file.write_text(scenario)
        options = ["--ros2", "--ros2-stamped", *["--ros2-lockstep"] * lockstep, "--ros2-patience", "300", "--json"]
        self.simulator = self._start(Peer, str(PEERS / "simulator.py"), str(file), "--out", str(self.run), *options)
        self.client = self._start(Client)
        self.client.wait(self.client.do(order="look", topic="/clock"), "seen")  # the configuration is written now
        self.start_node()

    def start_node(self):
        """Start our node and wait until it takes goals."""
        options = ["--stamped", *self._sensors, "--max-silence", "60", "--no-nav2", "--", "-p", "use_sim_time:=true"]
        file = str(self.run / "navigation.yaml")
        self.node = self._start(Peer, str(PEERS / "node.py"), file, *options, **BRIEF_LEASE)
        self.node.wait_for(lambda line: "is ready" in line.get("text", ""))
        self.client.meet()

    def _start(self, kind, *arguments, **variables):
        peer = kind(self._folder, self._domain, self._logs, *arguments, **variables)
        self._closing.callback(peer.end)
        return peer

    def say_that_it_is_at(self, x, y):
        """Tell the localisation of the robot, and wait until plans begin there."""
        self.client.wait(self.client.do(order="place", x=x, y=y), "placed")
        deadline = time.monotonic() + WITHIN
        while (begin := self.planned(x + 1.0, y)["poses"][0]) != pytest.approx([x, y], abs=0.1):
            assert time.monotonic() < deadline, begin

    def planned(self, x, y):
        return self.client.wait(self.client.send("get_path", target=[x, y]), "result")


@pytest.fixture
def driven(ros_folder, tmp_path):
    with ExitStack() as closing:
        yield partial(DrivenWorld, closing, ros_folder, tmp_path)


def judge(world):
    """Drive to the goal of the scenario: client and run know the same outcome."""
    world.client.wait("goal", "shown")
    assert world.client.result("move_base", shown=True) == ("succeeded", MoveBaseOutcome.SUCCESS)
    judged = world.simulator.wait_for(lambda line: "outcome_code" in line)
    assert judged["outcome_code"] == MoveBaseOutcome.SUCCESS and judged["success"]
    assert world.simulator.wait_for_end() == 0
    return judged["metrics"]


def test_indoors_the_robot_believes_where_it_is_said_to_be_and_its_goal_is_reached(driven):
    world = driven(INDOOR, "--sensor", "scan:LaserScan=lidar")
    world.say_that_it_is_at(3.4, 3.0)
    world.say_that_it_is_at(3.0, 3.0)
    assert judge(world)["path_length_m"] > 0.8


def test_outdoors_a_goal_is_reached_with_the_same_outcome_for_its_client_and_for_the_run(driven):
    assert judge(driven(outdoor()))["path_length_m"] > 1.0


def test_a_robot_whose_node_is_killed_stands_within_its_command_timeout_and_reaches_the_next_goal(driven):
    """In simulated time, which goes on with real time: what is asserted does not depend on the machine."""
    world = driven(FARTHER, "--sensor", "scan:LaserScan=lidar", lockstep=False)
    world.client.wait("goal", "shown")
    goal = world.client.send("move_base", shown=True)
    world.client.wait_for(lambda line: line.get("key") == goal and 1.0 < line.get("dist", 0.0) < 3.0)
    world.node.kill()
    world.client.part()
    world.start_node()
    judge(world)
    events = [json.loads(line) for line in (world.run / "events.jsonl").read_text("utf-8").splitlines()]
    stops = [event["data"]["reason"] for event in events if event["kind"] == "robot_stopped"]
    silences = [float(found[1]) for stop in stops if (found := re.match(r"no command for ([0-9.]+) s", stop))]
    assert silences and max(silences) < COMMAND_TIMEOUT + STEP, stops
