"""``mbf bridge connect`` to the rosbridge of a robot on Jazzy: rosbridge-server-rs, of which rclpy is a client."""

import signal
import socket
import sys
from contextlib import ExitStack

import pytest

from mbf_abstract.outcomes import GetPathOutcome, MoveBaseOutcome
from tests.system.ros2.conftest import PEERS, ROBOT, Client, Peer, Robot
from tests.system.ros2.environments import MBF, free_domain

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
SUCCEEDED, CANCELED = ("succeeded", MoveBaseOutcome.SUCCESS), ("canceled", MoveBaseOutcome.CANCELED)


class RobotWithRosbridge:
    """The nodes of a robot, its rosbridge, and a navigator that is a client of that and has no part of ROS."""

    def __init__(self, closing, folder, logs):
        self._closing, self._folder, self._logs = closing, folder, logs
        self._domain = free_domain(folder.parent, closing)
        with socket.create_server(("127.0.0.1", 0)) as free:
            self._port = str(free.getsockname()[1])
        config = logs / "robot.yaml"
        config.write_text(ROBOT)
        self.start_rosbridge()
        self.robot = self._start(Robot)
        address = f"ws://127.0.0.1:{self._port}"
        connect = "-c", MBF, "bridge", "connect", address, str(config), "--max-silence", "5"
        self.navigator = self._start(Peer, *connect, program=sys.executable)
        self.navigator.wait_for(lambda line: "is ready" in line.get("text", ""))
        self.start_client()

    def start_rosbridge(self):
        folders = str(self._folder / "interfaces"), str(self._logs / "rosbridge")
        self.rosbridge = self._start(Peer, str(PEERS / "rosbridge.py"), self._port, *folders)
        self.rosbridge.wait_for(lambda line: "listening" in line.get("text", ""))

    def start_client(self):
        """Start a client that sees only those who are there now."""
        self.client = self._start(Client)
        self.client.wait(self.client.do(order="find", actions=["move_base", "recovery"]), "found")

    def _start(self, kind, *arguments, **fields):
        peer = kind(self._folder, self._domain, self._logs, *arguments, **fields)
        self._closing.callback(peer.end)
        return peer

    def drive(self):
        """Begin to drive to a place that is a minute away; returns the key of the goal."""
        start = len(self.robot.lines)
        goal = self.client.send("move_base", target=[30.0, 0.0])
        self.robot.wait_for_speed(lambda speed: speed > 0.0, start)
        return goal

    def result(self, goal):
        end = self.client.wait(goal, "result")
        return end["status"], end["outcome"]

    def cancel(self, goal):
        self.client.order({"order": "cancel", "key": goal})
        return self.result(goal)


@pytest.fixture(scope="module")
def robot(jazzy_folder, tmp_path_factory):
    with ExitStack() as closing:
        yield RobotWithRosbridge(closing, jazzy_folder, tmp_path_factory.mktemp("robot"))


def test_a_goal_comes_through_the_robots_rosbridge_and_commands_go_back(robot):
    goal = robot.client.send("move_base", target=[1.0, 0.0])
    assert robot.client.wait(goal, "feedback")["dist"] > 0.0
    assert robot.result(goal) == SUCCEEDED
    assert robot.robot.x == pytest.approx(1.0, abs=0.3)


def test_a_goal_is_canceled_and_the_robot_stops(robot):
    goal, before = robot.drive(), len(robot.robot.lines)
    assert robot.cancel(goal) == CANCELED
    robot.robot.wait_for_speed(lambda speed: speed == 0.0, before)


def test_a_newer_goal_takes_the_robot_over_beside_a_goal_of_another_slot(robot):
    waiting = robot.client.send("recovery", behavior="pause", concurrency_slot=1)
    older = robot.drive()
    newer = robot.client.send("move_base", target=[robot.robot.x, 0.0])
    assert robot.result(older) == ("aborted", MoveBaseOutcome.CANCELED)
    assert robot.result(newer) == SUCCEEDED
    assert robot.result(waiting)[0] == "succeeded"


def test_a_pose_that_means_nothing_ends_aborted_with_a_text(robot):
    end = robot.client.wait(robot.client.send("move_base", target=[1.0, 0.0, "map", 0.0]), "result")
    assert (end["status"], end["outcome"]) == ("aborted", GetPathOutcome.INVALID_GOAL)
    assert "is not a rotation" in end["message"]


def test_after_the_rosbridge_is_killed_the_robot_stands_until_the_next_goal_which_works(robot):
    robot.drive()
    heard, connected = len(robot.robot.lines), len(robot.navigator.lines)
    robot.rosbridge.kill()
    robot.robot.wait_until_it_stands(heard)
    heard = len(robot.robot.lines)
    robot.robot.process.send_signal(signal.SIGSTOP)  # so that it does not hear the first zero through the new server
    robot.start_rosbridge()
    robot.navigator.wait_for(lambda line: "waiting: no message" in line.get("text", ""), connected)
    robot.robot.process.send_signal(signal.SIGCONT)
    robot.navigator.wait_for(lambda line: "is ready" in line.get("text", ""), connected)
    assert robot.robot.wait_for(lambda line: "speed" in line, heard)["speed"] == 0.0
    robot.client.kill()
    robot.start_client()
    target = robot.robot.x + 1.0
    goal = robot.client.send("move_base", target=[target, 0.0])
    assert robot.result(goal) == SUCCEEDED
    assert robot.robot.x == pytest.approx(target, abs=0.3)
