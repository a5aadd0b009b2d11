"""What fails to come, jumps or is killed: the robot is stopped, and the next goal works."""

import signal
from pathlib import Path

import pytest

from mbf_abstract.outcomes import ExePathOutcome, MoveBaseOutcome

PEERS = Path(__file__).parent / "peers"
pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900)]


def drive(trio, x):
    """Begin to drive to a place far away; returns the key of the goal."""
    start = len(trio.robot.lines)
    goal = trio.client.send("move_base", target=[x, 0.0])
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, start)
    return goal


@pytest.mark.parametrize("topic", ["tf", "odom", "scan"])
def test_a_robot_of_which_nothing_is_heard_is_stopped_and_goes_on_when_it_is_heard_again(trio, topic):
    goal = drive(trio, 8.0)
    before = len(trio.robot.lines)
    trio.robot.set(topic, "off")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    trio.robot.set(topic, "on")
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, len(trio.robot.lines))
    trio.client.order({"order": "cancel", "key": goal})
    assert trio.client.wait(goal, "result")["status"] == "canceled"


def test_a_goal_ends_with_tf_error_when_the_robot_is_killed_and_the_next_one_works(trio):
    goal = drive(trio, -8.0)
    trio.robot.kill()
    end = trio.client.wait(goal, "result")
    assert (end["status"], end["outcome"]) == ("aborted", ExePathOutcome.TF_ERROR)
    said = len(trio.node.lines)
    trio.robot = trio.start(type(trio.robot), *trio.robot_arguments)
    trio.wait_until_ready(said)
    assert trio.client.wait(trio.client.send("move_base", target=[0.5, 0.0]), "result")["status"] == "succeeded"


def test_the_goal_of_a_new_client_takes_over_that_of_a_killed_one(trio):
    drive(trio, -8.0)
    trio.client.kill()
    trio.client = trio.start(type(trio.client))
    trio.client.wait("", "ready")
    assert trio.client.result("move_base", target=[0.0, 0.0]) == ("succeeded", MoveBaseOutcome.SUCCESS)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 128 + signal.SIGTERM)])
def test_zero_is_the_last_command_of_a_node_that_is_ended(start_trio, number, code):
    trio = start_trio()
    goal = drive(trio, 8.0)
    before = len(trio.robot.lines)
    trio.node.process.send_signal(number)
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    assert trio.client.wait(goal, "result")["status"] == "aborted"
    assert trio.node.process.wait(60) == code
    assert [line["speed"] for line in trio.robot.lines if "speed" in line][-1] == 0.0


def test_zero_is_the_last_command_of_a_node_in_which_a_callback_raises(start_trio):
    trio = start_trio(program=[str(PEERS / "faulty_node.py")])
    drive(trio, 8.0)
    before = len(trio.robot.lines)
    trio.robot.set("fail", "now")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    assert trio.node.process.wait(60) == 1
    assert [line["speed"] for line in trio.robot.lines if "speed" in line][-1] == 0.0


def test_goals_end_with_tf_error_when_simulated_time_jumps_back_and_the_next_one_works(start_trio):
    trio = start_trio(simulated=True)
    goal = drive(trio, 8.0)
    trio.robot.set("clock", 500.0)
    end = trio.client.wait(goal, "result")
    assert (end["status"], end["outcome"]) == ("aborted", MoveBaseOutcome.TF_ERROR)
    assert "ROS time jumped by -" in end["message"]
    assert trio.client.result("move_base", target=[0.5, 0.0]) == ("succeeded", MoveBaseOutcome.SUCCESS)


def test_a_robot_is_stopped_when_simulated_time_stops(start_trio):
    trio = start_trio(simulated=True)
    drive(trio, 8.0)
    before = len(trio.robot.lines)
    trio.robot.set("clock", "off")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
