"""What fails to come, fails or is killed: the robot is stopped, and the next goal works. And what is left behind."""

import signal
from pathlib import Path

import pytest

from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from tests.system.ros2.conftest import ROBOT

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
CONFIG = ROBOT.replace("type: keepout}]", "type: keepout}, {name: seen, type: obstacle}]").replace(
    "area: {zones: []}", "area: {zones: []}, seen: {sources: {scan: {expected_update_rate: 30.0}}}"
)
CONFIG += "tf_timeout: 30.0\n"
OPTIONS = ("--no-nav2", "--max-silence", "5")  # the first limit; a busy machine keeps the robot silent for a while
ROUND, ROUNDS = 500, 8
GROWTH = 5  # kB a goal: a third of what a goal takes with its result, which rclpy keeps for 10 s


def held_by(process):
    """Threads, open files and memory [kB] of a process."""
    folder = Path(f"/proc/{process.pid}")
    status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
    return int(status["Threads"]), len(list((folder / "fd").iterdir())), int(status["VmRSS"].split()[0])


def plan(trio, number):
    """Ask for a plan so many times; returns how often each outcome came."""
    outcomes = trio.client.wait(trio.client.do(order="repeat", number=number), "repeated")["outcomes"]
    return {int(outcome): count for outcome, count in outcomes.items()}


def test_goals_that_are_over_leave_nothing_behind(trio):
    """Memory stops growing once the results of the first rounds are forgotten, however fast the rounds are."""
    assert plan(trio, 200) == {GetPathOutcome.SUCCESS: 200}
    threads, files, memory = held_by(trio.node.process)
    growth = []
    while not growth or (growth[-1] >= GROWTH and len(growth) < ROUNDS):
        assert plan(trio, ROUND) == {GetPathOutcome.SUCCESS: ROUND}
        later_threads, later_files, later_memory = held_by(trio.node.process)
        assert later_threads <= threads + 2 and later_files <= files + 2  # a thread may just be ending
        growth.append((later_memory - memory) / ROUND)
        memory = later_memory
    assert growth[-1] < GROWTH, growth


def test_the_robot_stops_when_the_node_is_killed_and_a_new_node_takes_the_next_goal(trio):
    trio.drive()
    before = len(trio.robot.lines)
    trio.kill_node()
    stood = trio.robot.wait_until_it_stands(before)
    trio.start_node()
    trio.wait_until_ready()
    assert trio.client.result("move_base", target=[stood + 0.5, 0.0]) == ("succeeded", MoveBaseOutcome.SUCCESS)
    assert abs(trio.robot.x - stood - 0.5) < 0.3


def test_a_goal_ends_with_tf_error_when_the_robot_is_killed_and_the_next_one_works(trio):
    """Of exe_path: that its map is not current any more, either, is no reason to recover and plan again."""
    goal = trio.drive()
    assert trio.client.put("controller_patience", 1.0)["successful"]
    trio.robot.kill()
    end = trio.client.wait(goal, "result")
    assert (end["status"], end["outcome"]) == ("aborted", ExePathOutcome.TF_ERROR)
    assert trio.client.put("controller_patience", 60.0)["successful"]
    said = len(trio.node.lines)
    trio.start_robot()
    trio.wait_until_ready(said)
    assert trio.client.result("move_base", target=[0.5, 0.0])[0] == "succeeded"


@pytest.mark.parametrize("topic", ["tf", "odom", "scan"])
def test_a_robot_of_which_nothing_is_heard_is_stopped_and_goes_on_when_it_is_heard_again(trio, topic):
    goal = trio.drive()
    before = len(trio.robot.lines)
    trio.robot.set(topic, "off")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    trio.robot.set(topic, "on")
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, len(trio.robot.lines))
    assert trio.cancel(goal)["status"] == "canceled"


def test_the_robot_is_stopped_when_the_client_of_its_goal_is_killed_and_the_next_goal_works(trio):
    trio.drive()
    before = len(trio.robot.lines)
    trio.client.kill()
    stopped = trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    assert abs(stopped["x"]) < 25.0  # the goal is at 30 m or at -30 m
    trio.start_client()
    trio.client.meet()
    goal = trio.client.result("move_base", target=[trio.robot.x, 0.0])
    assert goal == ("succeeded", MoveBaseOutcome.SUCCESS)


def test_the_goal_of_a_killed_client_goes_on_where_that_is_asked_for(trio):
    trio.kill_node()
    trio.start_node("--keep-goals")
    trio.wait_until_ready()
    target = trio.robot.x + 10.0
    trio.client.send("move_base", target=[target, 0.0])
    before = len(trio.robot.lines)
    trio.client.kill()
    trio.robot.wait_for(lambda line: line.get("speed") == 0.0 and abs(line["x"] - target) < 0.3, before)
    trio.start_client()
    trio.client.meet()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 128 + signal.SIGTERM)])
def test_zero_is_the_last_command_of_a_node_that_is_ended(trio, number, code):
    goal = trio.drive()
    trio.node.process.send_signal(number)
    assert trio.client.wait(goal, "result")["status"] == "aborted"
    assert trio.node.wait_for_end() == code
    trio.robot.wait_until_last_speed_is_zero()


def test_zero_is_the_last_command_of_a_node_whose_parent_is_killed(trio):
    trio.kill_node()
    trio.start_node(before=("sh", "-c", '"$0" "$@"; true'))
    trio.wait_until_ready()
    goal = trio.drive()
    trio.node.process.kill()
    assert trio.client.wait(goal, "result")["status"] == "aborted"
    trio.node.wait_for_last_line()
    trio.robot.wait_until_last_speed_is_zero()


def test_zero_is_the_last_command_of_a_node_in_which_a_callback_raises(trio):
    trio.drive()
    trio.robot.set("fail", "now")
    assert trio.node.wait_for_end() == 1
    trio.robot.wait_until_last_speed_is_zero()


def test_a_goal_that_raises_ends_with_internal_error_and_stops_the_robot_and_the_node(trio):
    path = trio.client.wait(trio.client.send("get_path", target=[trio.robot.x + 20.0, 0.0]), "result")["poses"]
    before = len(trio.robot.lines)
    goal = trio.client.send("exe_path", path=path)
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, before)
    end = trio.cancel(goal)
    assert (end["status"], end["outcome"]) == ("aborted", ExePathOutcome.INTERNAL_ERROR)
    assert "a fault of ours" in end["message"]
    assert trio.node.wait_for_end() == 1
    trio.robot.wait_until_last_speed_is_zero()
