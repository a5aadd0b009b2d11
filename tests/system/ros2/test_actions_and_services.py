"""A real rclpy client of our node: actions, services and parameters of mbf_msgs, with a robot that is a node, too."""

import json
import re
from pathlib import Path

import pytest

from mbf_abstract.maps.queries import CellState
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome
from mbf_ros.ros2.actions import MAX_GOALS
from mbf_ros.ros2.interfaces.definitions import types_of
from tests.system.ros2.conftest import ROBOT
from tests.system.ros2.environments import JAZZY, KILTED

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
PAIRS = [("kilted", "kilted"), ("kilted", "jazzy"), ("jazzy", "kilted")]
OPTIONS = ("--max-silence", "5")  # a machine that is busy keeps the robot silent for longer than is usual
CONFIG = ROBOT.replace("type: wait}", "type: wait}, {name: long_pause, type: wait}")
CONFIG += "recovery_patience: 600.0\nlong_pause: {duration: 600.0}\n"
HASHES = Path(__file__).parents[2] / "unit" / "ros" / "type_hashes.txt"


WHOLE = {  # the released packages as ROS 2 compiles them
    "mbf_msgs/action/ExePath": "f28504660c6ef5f81768059e9d7dc4207c25674b2577a32a826e59853b905628",
    "mbf_msgs/action/GetPath": "5b335c7a798a7847579ec5a2dfbbe64fe214a6b5c1ddadaf842f9ccf9a799559",
    "mbf_msgs/action/MoveBase": "e718813f5b7f7bc9d92ac2c3762e7256daf412483ee1e7be758182f334044884",
    "mbf_msgs/action/Recovery": "bd8ef73ff847812ffb0a09adda1bb67188deb9e4aed231cd6ccdaa230e3d74a5",
    "mbf_msgs/srv/CheckPath": "e17ad2d3a6087455a5b9e9f093d26ab144c6586dbc25bc246e5f6ea51438e278",
    "mbf_msgs/srv/CheckPoint": "5eb56417197fcaaa0a9275ef052d7b18827ff5640d595fc37515374bc5711ae6",
    "mbf_msgs/srv/CheckPose": "fd0ef3e51c8b6ac1ea079f6cbcade2dacab29662a64574068c6165bc85e7b6b5",
    "mbf_msgs/srv/FindValidPose": "a131eaf8f3ac2ea3f243b500254b61c577f1fd1dbda48a78dc1c2dc7f88212e0",
    "nav2_msgs/action/BackUp": "cc8889ed926f2e6956d1a3d0459e8e610289ed689efdcf8bcff3e4a349cea741",
    "nav2_msgs/action/ComputePathThroughPoses": "938bb3fbebc5dc9fde6be247d2700763eedccfd0f49d3f21fafee418ec9213e9",
    "nav2_msgs/action/ComputePathToPose": "b11d50c914791956069419b8f4ad441e3c66fcfbd9461f8e87110b77dc6febe9",
    "nav2_msgs/action/DriveOnHeading": "14e7a7c5a558249d00ffe1e1ad64c06f4ac85f3527f04811dba9cf0cb0cc38a8",
    "nav2_msgs/action/FollowPath": "9d95513552fb578cfb933d7e0160273911269cbdf4b348f1acb87d8a903b13cf",
    "nav2_msgs/action/FollowWaypoints": "667c9e9d426ede27da21dd3cdd3a34e4fc5cc6405b35bc9d5c0b084479920f54",
    "nav2_msgs/action/NavigateThroughPoses": "79fd41c3d79022e194035040f5adee498dfe56e797ede67e5ca31591d9f52eef",
    "nav2_msgs/action/NavigateToPose": "a56dba8a3234a1215e610180dc703ae25bbf406dded8b54887891c9732857eab",
    "nav2_msgs/action/SmoothPath": "84ea77c54dbe197a3d45c188124cf4535b1a1f3f0ffd2f86b841a1d63f1c2cda",
    "nav2_msgs/action/Spin": "8463b23d8454c92f735dbc77a62138d4e8570570939e39eab993dd63d8442925",
    "nav2_msgs/action/Wait": "0c5d418b19d8d009bb5bce6dca27687d9d43659016a70dc08307e38a032af2c3",
    "nav2_msgs/srv/ClearCostmapAroundRobot": "24973b6e8b3e7ec70c37d6b411f1e32cef44051dfe7f34ad0ee7d6d9055cd6ea",
    "nav2_msgs/srv/ClearCostmapExceptRegion": "66032323269ef923ab356273a7b7fc1c5acd9ccd46cd14bdcd265642a4012b05",
    "nav2_msgs/srv/ClearEntireCostmap": "553f54f9cadab44553fdf5627433fcb6701f71c1fc2eb55a7b4a004fdeeab952",
    "nav2_msgs/srv/IsPathValid": "2401d5bf42a039352d891bd166423067a5a3860e33b01e278855b98b346b544b",
}


def interface_of(name):
    """Name of the interface that a part belongs to."""
    return re.sub(r"_(Goal|Result|Feedback|Request|Response)$", "", name)


def own_interfaces(distribution):
    """Names of the interfaces that are not those of Kilted: with other fields, or in one of the two only."""
    types, known = types_of(distribution), types_of("kilted")
    return {interface_of(name) for name in {*types, *known} if types.get(name) != known.get(name)}


def test_peers_of_tests_share_no_memory_that_a_killed_one_could_leave_locked(trio):
    """The profile of Fast DDS counts for each distribution: with its default, these are mapped."""
    for peer in (trio.robot, trio.node, trio.client):
        assert "/dev/shm/fast" not in Path(f"/proc/{peer.process.pid}/maps").read_text()


@pytest.mark.parametrize("distribution", [KILTED, JAZZY], ids=lambda one: one.name)
def test_the_compiled_types_have_the_hashes_of_the_released_packages(distribution, request):
    folder = request.getfixturevalue("ros_folder" if distribution is KILTED else "jazzy_folder")
    released = dict(line.split() for line in HASHES.read_text().splitlines() if not line.startswith("#"))
    descriptions = [json.loads(file.read_text()) for file in (folder / "interfaces").rglob("*.json")]
    compiled = {one["type_name"]: one["hash_string"] for described in descriptions for one in described["type_hashes"]}
    whole = {name: f"RIHS01_{digits}" for name, digits in WHOLE.items()}
    own = own_interfaces(distribution.name)  # whose hashes in Jazzy nobody has noted
    ours = {
        name: value
        for name, value in (released | whole).items()
        if name.startswith(distribution.packages) and interface_of(name) not in own
    }
    assert len(ours) > 30
    assert {name: compiled.get(name) for name in ours} == ours


def test_the_robot_drives_to_a_goal_with_feedback_on_its_way(trio):
    start, x = len(trio.robot.lines), trio.robot.x + 1.0
    goal = trio.client.send("move_base", target=[x, 0.0])
    assert 0.0 < trio.client.wait(goal, "feedback")["dist"] < 1.2  # of a busy client the first ones may be lost
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


def test_a_goal_too_many_is_rejected_and_taken_once_the_others_are_over(trio):
    slots = range(1, MAX_GOALS + 1)
    taken = [trio.client.send("recovery", behavior="long_pause", concurrency_slot=slot) for slot in slots]
    one_more = {"behavior": "long_pause", "concurrency_slot": MAX_GOALS + 1}
    trio.client.wait(trio.client.do(order="send", action="recovery", **one_more), "rejected")
    assert {trio.cancel(goal)["outcome"] for goal in taken} == {RecoveryOutcome.CANCELED}
    assert trio.cancel(trio.client.send("recovery", **one_more))["outcome"] == RecoveryOutcome.CANCELED


def test_goals_sent_and_canceled_at_once_are_all_accepted_and_all_have_their_result(trio):
    """With as many places in the client's queues; with rclpy's own ten it loses results, see docs/ros2.md."""
    burst = trio.client.do(order="burst", number=MAX_GOALS)
    assert trio.client.wait(burst, "accepted")["number"] == MAX_GOALS
    assert trio.client.wait(burst, "over")["outcomes"] == {str(int(RecoveryOutcome.CANCELED)): MAX_GOALS}


def test_a_goal_that_is_accepted_while_it_is_still_being_sent_has_its_result(trio):
    assert trio.client.result("get_path", target=[1.0, 0.0], late=True) == ("succeeded", GetPathOutcome.SUCCESS)


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
    assert read("planners", "controllers", "shortest.type", "global_frame", "odom_topic") == [
        ["shortest"],
        ["follow"],
        "straight_line",
        "map",
        "odom",
    ]
    assert trio.client.put("controller_patience", 4.0)["successful"]
    assert read("controller_patience") == [4.0]
    refused = trio.client.put("controller_patience", -1.0)
    assert not refused["successful"] and "controller_patience" in refused["reason"]
    assert trio.client.put("controller_patience", 60.0)["successful"]
