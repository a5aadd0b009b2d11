"""A real rclpy client of our node: actions, services and parameters of mbf_msgs, with a robot that is a node, too."""

import json
from pathlib import Path

import pytest

from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from mbf_ros.ros2.interfaces.definitions import PACKAGES

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900)]
HASHES = Path(__file__).parents[2] / "unit" / "ros" / "type_hashes.txt"


WHOLE = {  # the released mbf_msgs as ROS 2 compiles it
    "mbf_msgs/action/ExePath": "RIHS01_f28504660c6ef5f81768059e9d7dc4207c25674b2577a32a826e59853b905628",
    "mbf_msgs/action/GetPath": "RIHS01_5b335c7a798a7847579ec5a2dfbbe64fe214a6b5c1ddadaf842f9ccf9a799559",
    "mbf_msgs/action/MoveBase": "RIHS01_e718813f5b7f7bc9d92ac2c3762e7256daf412483ee1e7be758182f334044884",
    "mbf_msgs/action/Recovery": "RIHS01_bd8ef73ff847812ffb0a09adda1bb67188deb9e4aed231cd6ccdaa230e3d74a5",
    "mbf_msgs/srv/CheckPath": "RIHS01_e17ad2d3a6087455a5b9e9f093d26ab144c6586dbc25bc246e5f6ea51438e278",
    "mbf_msgs/srv/CheckPoint": "RIHS01_5eb56417197fcaaa0a9275ef052d7b18827ff5640d595fc37515374bc5711ae6",
    "mbf_msgs/srv/CheckPose": "RIHS01_fd0ef3e51c8b6ac1ea079f6cbcade2dacab29662a64574068c6165bc85e7b6b5",
    "mbf_msgs/srv/FindValidPose": "RIHS01_a131eaf8f3ac2ea3f243b500254b61c577f1fd1dbda48a78dc1c2dc7f88212e0",
}


def test_the_compiled_types_have_the_hashes_of_the_released_packages(ros_folder):
    released = dict(line.split() for line in HASHES.read_text().splitlines() if not line.startswith("#"))
    descriptions = [json.loads(file.read_text()) for file in (ros_folder / "interfaces").rglob("*.json")]
    compiled = {one["type_name"]: one["hash_string"] for described in descriptions for one in described["type_hashes"]}
    ours = {name: value for name, value in released.items() if name.startswith(PACKAGES)} | WHOLE
    assert {name: compiled.get(name) for name in ours} == ours


def test_the_robot_drives_to_a_goal_with_feedback_on_its_way(trio):
    start, x = len(trio.robot.lines), trio.robot.x + 1.0
    goal = trio.client.send("move_base", target=[x, 0.0])
    assert trio.client.wait(goal, "feedback")["dist"] > 0.5
    end = trio.client.wait(goal, "result")
    assert (end["status"], end["outcome"]) == ("succeeded", MoveBaseOutcome.SUCCESS)
    trio.robot.wait_for(lambda line: line.get("speed") == 0.0 and abs(line["x"] - x) < 0.3, start)


def test_a_path_is_planned_and_driven(trio):
    end = trio.client.wait(trio.client.send("get_path", target=[0.0, 0.0]), "result")
    assert end["status"] == "succeeded" and end["poses"][-1] == pytest.approx([0.0, 0.0], abs=0.01)
    assert trio.client.result("exe_path", path=end["poses"]) == ("succeeded", ExePathOutcome.SUCCESS)


def test_a_recovery_runs(trio):
    assert trio.client.result("recovery", behavior="pause") == ("succeeded", 0)


def test_a_canceled_goal_leaves_the_robot_standing(trio):
    goal = trio.drive()
    before = len(trio.robot.lines)
    end = trio.cancel(goal)
    assert (end["status"], end["outcome"]) == ("canceled", MoveBaseOutcome.CANCELED)
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)


def test_a_goal_for_a_used_slot_takes_the_robot_over(trio):
    first = trio.drive()
    second = trio.client.send("move_base", target=[trio.robot.x, 0.0])
    end = trio.client.wait(first, "result")
    assert (end["status"], end["outcome"]) == ("aborted", MoveBaseOutcome.CANCELED)
    assert trio.client.wait(second, "result")["status"] == "succeeded"


def test_goals_of_two_slots_run_beside_each_other(trio):
    waiting = trio.client.send("recovery", behavior="pause", concurrency_slot=1)
    assert trio.client.result("get_path", target=[1.0, 1.0], concurrency_slot=2)[0] == "succeeded"
    assert trio.client.wait(waiting, "result")["status"] == "succeeded"


@pytest.mark.parametrize(
    ("action", "fields", "outcome"),
    [
        ("move_base", {"target": [1.0, 0.0, "map", 0.0]}, GetPathOutcome.INVALID_GOAL),
        ("get_path", {"target": [float("nan"), 0.0]}, GetPathOutcome.INVALID_GOAL),
        ("get_path", {"target": [1.0, 0.0], "planner": "nobody"}, GetPathOutcome.INVALID_PLUGIN),
        ("move_base", {"target": [1.0, 0.0, "nowhere"]}, MoveBaseOutcome.TF_ERROR),
        ("exe_path", {"path": []}, ExePathOutcome.INVALID_PATH),
    ],
)
def test_what_cannot_be_done_ends_aborted_with_outcome_and_text(trio, action, fields, outcome):
    end = trio.client.wait(trio.client.send(action, **fields), "result")
    assert (end["status"], end["outcome"]) == ("aborted", outcome)
    assert end["message"]


def test_the_map_is_asked(trio):
    ask = lambda **order: trio.client.wait(trio.client.do(order="call", costmap=2, **order), "answer")["state"]  # noqa: E731
    assert ask(service="check_point_cost", target=[1.0, 1.0]) == CellState.FREE
    assert ask(service="check_pose_cost", target=[100.0, 1.0]) == CellState.OUTSIDE
    assert ask(service="check_path_cost", path=[[0.0, 0.0], [1.0, 0.0]]) == CellState.FREE
    assert ask(service="find_valid_pose", target=[1.0, 1.0]) == CellState.FREE


def test_a_question_that_means_nothing_is_answered_as_unknown(trio):
    key = trio.client.do(order="call", service="check_pose_cost", target=[1.0, 0.0, "map", 0.0], costmap=2)
    assert trio.client.wait(key, "answer")["state"] == CellState.UNKNOWN


def test_a_paused_goal_stands_until_it_is_resumed(trio):
    goal = trio.drive()
    before = len(trio.robot.lines)
    trio.client.wait(trio.client.do(order="call", service="pause"), "answer")
    trio.robot.wait_for_speed(lambda speed: speed == 0.0, before)
    before = len(trio.robot.lines)
    trio.client.wait(trio.client.do(order="call", service="resume"), "answer")
    trio.robot.wait_for_speed(lambda speed: speed > 0.0, before)
    assert trio.cancel(goal)["status"] == "canceled"


def test_parameters_are_read_and_set_at_run_time(trio):
    read = lambda *names: trio.client.wait(trio.client.do(order="get", names=names), "values")["values"]  # noqa: E731
    assert read("planners", "controllers", "shortest.type", "global_frame") == [
        ["shortest"],
        ["follow"],
        "straight_line",
        "map",
    ]
    assert trio.client.put("controller_patience", 4.0)["successful"]
    assert read("controller_patience") == [4.0]
    refused = trio.client.put("controller_patience", -1.0)
    assert not refused["successful"] and "controller_patience" in refused["reason"]
    assert trio.client.put("controller_patience", 60.0)["successful"]
