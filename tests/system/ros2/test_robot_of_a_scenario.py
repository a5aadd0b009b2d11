"""Our node drives the robot of a scenario over ROS 2, in lockstep, to a goal that a client sends."""

from contextlib import ExitStack
from pathlib import Path

import pytest

import terrain.scenarios.scenario
from mbf_abstract.outcomes import MoveBaseOutcome
from tests.system.ros2.conftest import PEERS, Client, Peer
from tests.system.ros2.environments import free_domain

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900)]
CONFIG = Path(terrain.scenarios.scenario.__file__).parent / "library" / "config" / "indoor_costmap.yaml"
SCENARIO = f"""
name: to_the_door
proves: A robot of ours is driven over ROS 2.
backend: costmap
navigation: {{costmap: {CONFIG}}}
physics: kinematic
world: {{type: office}}
robot: turtlebot
start: {{x: 3.0, y: 3.0, yaw: 0.0}}
goals: [{{x: 4.0, y: 3.0, yaw: 0.0}}]
sensors: [{{name: lidar, type: planar, rate: 10.0, rays: 90, max_range: 8.0}}]
"""


def test_a_goal_is_reached_with_the_same_outcome_for_its_client_and_for_the_run(ros_folder, tmp_path):
    scenario, run = tmp_path / "scenario.yaml", tmp_path / "run"
    scenario.write_text(SCENARIO)
    with ExitStack() as closing:
        domain = free_domain(ros_folder.parent, closing)

        def start(kind, *arguments):
            peer = kind(ros_folder, domain, tmp_path, *arguments)
            closing.callback(peer.end)
            return peer

        options = ["--ros2", "--ros2-stamped", "--ros2-lockstep", "--ros2-patience", "300", "--json"]
        simulator = start(Peer, str(PEERS / "simulator.py"), str(scenario), "--out", str(run), *options)
        client = start(Client)
        client.wait(client.do(order="look", topic="/clock"), "seen")  # the configuration is written now
        sensor, silence = ["--sensor", "scan:LaserScan=lidar"], ["--max-silence", "60"]
        time = ["--", "-p", "use_sim_time:=true"]
        node = start(Peer, str(PEERS / "node.py"), str(run / "navigation.yaml"), "--stamped", *sensor, *silence, *time)
        node.wait_for(lambda line: "is ready" in line.get("text", ""))
        client.meet()
        assert client.result("move_base", target=[4.0, 3.0]) == ("succeeded", MoveBaseOutcome.SUCCESS)
        judged = simulator.wait_for(lambda line: "outcome_code" in line)
        assert judged["outcome_code"] == MoveBaseOutcome.SUCCESS and judged["success"]
        assert judged["metrics"]["path_length_m"] > 0.8
        assert simulator.wait_for_end() == 0
