"""Simulated time that stops, jumps or is faulty: the robot is stopped, and the next goal works."""

import signal

import pytest

from mbf_abstract.outcomes import MoveBaseOutcome

SIMULATED, OPTIONS = True, ("--no-nav2",)
pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]


def test_goals_end_with_tf_error_when_simulated_time_jumps_back_and_the_next_one_works(trio):
    goal = trio.drive()
    trio.robot.set("clock", 500.0)
    end = trio.client.wait(goal, "result")
    assert (end["status"], end["outcome"]) == ("aborted", MoveBaseOutcome.TF_ERROR)
    assert "ROS time jumped by -" in end["message"]
    assert trio.client.result("move_base", target=[0.5, 0.0]) == ("succeeded", MoveBaseOutcome.SUCCESS)


def test_a_robot_is_stopped_when_simulated_time_stops_and_goes_on_with_it(trio):
    goal = trio.drive()
    before = len(trio.robot.lines)
    trio.robot.set("clock", "off")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    trio.robot.set("clock", "on")
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, len(trio.robot.lines))
    assert trio.cancel(goal)["status"] == "canceled"


def test_a_canceled_goal_ends_and_the_next_one_works_although_simulated_time_stood_still(trio):
    goal = trio.drive()
    before = len(trio.robot.lines)
    trio.robot.set("clock", "off")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    assert trio.cancel(goal)["status"] == "canceled"
    trio.robot.set("clock", "on")
    assert trio.client.result("move_base", target=[0.5, 0.0]) == ("succeeded", MoveBaseOutcome.SUCCESS)


def test_a_node_that_waits_for_simulated_time_ends_when_a_callback_raises(trio):
    trio.node.process.send_signal(signal.SIGINT)
    assert trio.node.wait_for_end() == 0
    trio.robot.set("clock", 1.0)
    trio.start_node()
    assert trio.node.wait_for_end() == 2
