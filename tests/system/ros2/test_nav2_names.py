"""A client of Nav2 against our node, on a costmap and on a mesh: goals, behaviours and services by Nav2's names.

On Kilted, and on Jazzy, whose messages have other fields.
"""

import math
from contextlib import ExitStack

import numpy as np
import pytest
import trimesh

from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_ros.messages.nav2 import codes
from tests.system.ros2.conftest import Trio

pytestmark = [pytest.mark.ros2, pytest.mark.timeout(900, func_only=True)]
CLIENT = "commander.py"
OPTIONS = ("--amcl", "--max-silence", "5")  # a behavior ends where the robot falls silent, as on a busy machine
PLUGINS = """
controller_patience: 60.0
planner_patience: 60.0
recovery_patience: 60.0
tf_timeout: 10.0
max_vel_x: 0.5
recovery_behaviors:
  - {name: pause, type: wait}
  - {name: turn, type: rotate}
  - {name: back, type: back_up}
  - {name: straight, type: drive_on_heading}
turn: {time_limit: 60.0}
back: {time_limit: 60.0}
straight: {time_limit: 60.0}
"""
CONFIG = (
    PLUGINS
    + """
backend: costmap
global_costmap: {SIZE, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {SIZE, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
refiners: [{name: smooth, type: smoother}]
""".replace("SIZE", "width: 20.0, height: 20.0, resolution: 0.1, origin_x: -10.0, origin_y: -10.0")
)
MESH = (
    PLUGINS
    + """
backend: mesh
planners: [{name: wave, type: cvp}]
controllers: [{name: follow, type: path_follower}]
refiners: [{name: pull, type: string_pulling}]
mesh_map: {mesh_file: floor.ply, inscribed_radius: 0.3, default_layer: steep, layers: [{name: steep, type: steepness}]}
"""
)
SIZE = {"costmap": 20.0, "jazzy": 20.0, "mesh": 16.0}  # m from end to end of the maps
ON_COSTMAP = pytest.mark.parametrize("crew", ["costmap"], indirect=True)  # what does not depend on the map


ON_EACH = pytest.mark.parametrize("crew", ["costmap", "jazzy"], indirect=True)  # distribution


@pytest.fixture(scope="module")
def jazzy_trio(jazzy_folder, tmp_path_factory, request):
    with ExitStack() as closing:
        yield Trio(closing, jazzy_folder, tmp_path_factory.mktemp("jazzy"), request.module)


@pytest.fixture(scope="module", params=["costmap", "mesh", "jazzy"])
def crew(request):
    """Robot, node and commander; the node is started anew with the mesh."""
    module_trio = request.getfixturevalue("jazzy_trio" if request.param == "jazzy" else "module_trio")
    module_trio.is_jazzy = request.param == "jazzy"
    if request.param == "mesh":
        vertices, faces = heightfield_mesh(np.zeros((81, 81)), 0.2, 0.2)
        floor = trimesh.Trimesh(vertices - [8.0, 8.0, 0.0], faces, process=False)
        floor.export(module_trio.file.parent / "floor.ply")
        module_trio.file.write_text(MESH)
        module_trio.node.end()
        module_trio.start_node()
        module_trio.wait_until_ready()
    module_trio.map_size = SIZE[request.param]
    return module_trio


def goals(crew, *poses):
    """Several poses, which are a message of their own from Kilted on."""
    return list(poses) if crew.is_jazzy else {"goals": list(poses)}


def at(x, y=0.0):
    return {"header": {"frame_id": "map"}, "pose": {"position": {"x": x, "y": y}}}


def run(crew, action, goal, **options):
    return crew.client.wait(crew.client.do(order="task", action=action, goal=goal, **options), "result")


def ask(crew, service, request):
    return crew.client.wait(crew.client.do(order="ask", service=service, request=request), "answer")


def seconds(duration):
    return duration["sec"] + duration["nanosec"] * 1e-9


def test_a_path_is_planned_smoothed_checked_and_followed(crew):
    poses = goals(crew, at(0.4), at(0.8))
    planned = run(crew, "compute_path_through_poses", {"goals": poses, "start": at(0.0), "use_start": True})
    assert (planned["status"], planned["error_code"], planned["error_msg"]) == ("succeeded", 0, "")
    assert seconds(planned["planning_time"]) > 0.0
    smoothed = run(crew, "smooth_path", {"path": planned["path"]})
    assert smoothed["was_completed"] and seconds(smoothed["smoothing_duration"]) > 0.0
    assert ask(crew, "is_path_valid", {"path": smoothed["path"]})["is_valid"]
    followed = run(crew, "follow_path", {"path": smoothed["path"]})
    assert (followed["status"], followed["error_code"]) == ("succeeded", 0)
    assert followed["feedback"][-1]["distance_to_goal"] < 0.5


def test_feedback_on_the_way_to_a_pose_says_what_is_left_and_what_has_passed(crew):
    end = run(crew, "navigate_to_pose", {"pose": at(0.0 if crew.robot.x > 0.5 else 1.0)})
    assert (end["status"], end["error_code"]) == ("succeeded", 0)
    last = end["feedback"][-1]
    assert last["distance_remaining"] < 0.5
    assert seconds(last["navigation_time"]) > 0.0
    assert last["current_pose"]["header"]["frame_id"] == "map" and last["number_of_recoveries"] == 0


@ON_COSTMAP
def test_a_canceled_task_leaves_the_robot_standing(crew):
    assert run(crew, "navigate_to_pose", {"pose": at(7.0)}, cancel=True)["status"] == "canceled"
    crew.robot.wait_until_last_speed_is_zero()


@ON_EACH
def test_every_pose_of_a_way_is_passed_in_its_order(crew):
    end = run(crew, "navigate_through_poses", {"poses": goals(crew, at(0.5), at(0.5, 0.5))})
    assert (end["status"], end["error_code"]) == ("succeeded", 0)
    assert end["feedback"][-1]["number_of_recoveries"] == 0
    remaining = [one["number_of_poses_remaining"] for one in end["feedback"]]
    assert remaining == sorted(remaining, reverse=True)
    last = end["feedback"][-1]
    assert (last["number_of_poses_remaining"], last["distance_remaining"]) == (0, 0.0)
    assert last["current_pose"]["pose"]["position"]["y"] == pytest.approx(0.5, abs=0.4)
    for shown in () if crew.is_jazzy else (end, last):
        assert [one["waypoint_status"] for one in shown["waypoint_statuses"]] == [codes.WaypointState.COMPLETED] * 2


@ON_EACH
def test_a_missed_waypoint_is_named_and_the_others_are_visited(crew):
    end = run(crew, "follow_waypoints", {"poses": [at(0.5, 0.2), at(50.0), at(0.3, 0.0)]})
    visited = [one["current_waypoint"] for one in end["feedback"]]
    assert visited == sorted(visited) and visited[-1] == 2
    assert (end["status"], end["error_code"]) == ("aborted", codes.WaypointsCode.UNKNOWN)
    (missed,) = end["missed_waypoints"]
    assert crew.is_jazzy or missed["waypoint_status"] == codes.WaypointState.FAILED
    assert missed["index" if crew.is_jazzy else "waypoint_index"] == 1
    assert missed["goal" if crew.is_jazzy else "waypoint_pose"]["pose"]["position"]["x"] == 50.0
    assert missed["error_code"] == codes.PlanningCode.GOAL_OUTSIDE_MAP


def test_the_robot_turns_on_the_spot(crew):
    end = run(crew, "spin", {"target_yaw": -1.0, "time_allowance": {"sec": 50}})
    assert (end["status"], end["error_code"]) == ("succeeded", 0)
    assert end["feedback"][-1]["angular_distance_traveled"] == pytest.approx(-1.0, abs=0.25)


@ON_COSTMAP
@pytest.mark.parametrize(
    ("action", "goal", "field", "amount"),
    [
        ("backup", {"target": {"x": 0.3}, "speed": 0.3}, "distance_traveled", 0.3),
        ("drive_on_heading", {"target": {"x": 0.3}, "speed": 0.3}, "distance_traveled", 0.3),
        ("wait", {"time": {"sec": 1}}, "time_left", 0.0),
    ],
)
def test_a_behavior_does_what_its_goal_says_and_reports_it(crew, action, goal, field, amount):
    end = run(crew, action, goal)
    assert (end["status"], end["error_code"], end["error_msg"]) == ("succeeded", 0, "")
    reported = end["feedback"][-1][field]
    assert (seconds(reported) if action == "wait" else reported) == pytest.approx(amount, abs=0.25)
    assert seconds(end["total_elapsed_time"]) > 0.5


@ON_COSTMAP
@pytest.mark.parametrize(
    ("action", "goal", "code", "text"),
    [
        ("backup", {"target": {"y": 1.0}, "speed": 0.1}, codes.BackUpCode.INVALID_INPUT, "on the robot's x axis"),
        ("drive_on_heading", {"target": {"x": 99.0}, "speed": 0.1}, codes.DriveOnHeadingCode.INVALID_INPUT, "20"),
        ("spin", {"disable_collision_checks": True}, codes.SpinCode.UNKNOWN, "disable_collision_checks"),
        (
            "navigate_to_pose",
            {"pose": at(1.0), "behavior_tree": "t"},
            codes.NavigateCode.FAILED_TO_LOAD_BEHAVIOR_TREE,
            "behavior_tree",
        ),
        (
            "smooth_path",
            {"path": {"poses": [at(0.0), at(1.0)]}, "smoother_id": "s"},
            codes.SmoothingCode.INVALID_SMOOTHER,
            "'s'",
        ),
        ("follow_path", {"goal_checker_id": "g"}, codes.FollowPathCode.INVALID_CONTROLLER, "goal_checker_id"),
        ("compute_path_to_pose", {"goal": at(1.0), "planner_id": "p"}, codes.PlanningCode.INVALID_PLANNER, "'p'"),
        ("navigate_to_pose", {"pose": at(math.nan)}, codes.NavigateCode.UNKNOWN, "INVALID_GOAL"),
    ],
)
def test_what_cannot_be_done_ends_aborted_with_a_code_of_nav2_and_a_text(crew, action, goal, code, text):
    end = run(crew, action, goal)
    assert (end["status"], end["error_code"]) == ("aborted", code)
    assert text in end["error_msg"]


def test_a_path_that_leaves_the_map_is_not_valid_from_there_on(crew):
    far = [at(0.0), at(1.0), at(crew.map_size), at(crew.map_size + 1.0)]
    assert ask(crew, "is_path_valid", {"path": {"poses": far}})["invalid_pose_indices"] == [2, 3]
    assert not ask(crew, "is_path_valid", {"path": {"poses": []}})["is_valid"]
