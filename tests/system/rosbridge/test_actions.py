"""Goals of roslibpy clients: feedback, result, cancel, take-over, and what is no goal."""

import pytest
import roslibpy

from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from mbf_abstract.plugins import PlanResult
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_ros.messages.geometry import MessageContext, path_message
from mbf_ros.messages.interfaces import fields_of
from mbf_ros.rosbridge.navigation import ACTIONS
from tests.system.rosbridge.conftest import creep

SUCCEEDED, CANCELED, ABORTED = (roslibpy.core.GoalStatus(code) for code in (4, 5, 6))


def target(x, y=0.0, **fields):
    return {"header": {"frame_id": "map"}, "pose": {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}, **fields}}


class Goal:
    """A goal of a roslibpy client, and what it gets back."""

    def __init__(self, answers, ros, name, kind, goal):
        self.results, self.feedback, self.errors = answers(), answers(), answers()
        self.client = roslibpy.ActionClient(ros, name, kind)
        self.id = self.client.send_goal(roslibpy.Goal(goal), self.results, self.feedback, self.errors)

    def result(self):
        (result,) = self.results.wait()
        return result["status"], result["values"]

    def error(self):
        (error,) = self.errors.wait()
        return error["values"]

    def cancel(self):
        self.client.cancel_goal(self.id)


@pytest.fixture
def send(answers):
    def make(ros, name, kind, goal):
        return Goal(answers, ros, name, kind, goal)

    return make


def test_move_base_drives_and_answers_with_feedback_and_a_result(serving, connect, send):
    session, server = serving()
    goal = send(
        connect(server.port), "/move_base_flex/move_base", "mbf_msgs/action/MoveBase", {"target_pose": target(0.6)}
    )
    status, values = goal.result()
    assert (status, values["outcome"]) == (SUCCEEDED, MoveBaseOutcome.SUCCESS)
    assert values["final_pose"]["pose"]["position"]["x"] == pytest.approx(0.6, abs=0.3)
    assert session.robot.pose.x > 0.3
    last = goal.feedback.wait()[-1]
    assert last["dist_to_goal"] <= 0.7 and last["current_pose"]["header"]["frame_id"] == "map"


def test_nav2_clients_navigate_too(serving, connect, send):
    _, server = serving()
    ros = connect(server.port)
    status, values = send(ros, "/navigate_to_pose", "nav2_msgs/NavigateToPose", {"pose": target(0.5)}).result()
    assert (status, values) == (SUCCEEDED, {"error_code": 0, "error_msg": ""})


def test_a_path_is_planned_and_driven_as_it_came(serving, connect, send):
    _, server = serving()
    ros = connect(server.port)
    plan = send(ros, "/move_base_flex/get_path", "mbf_msgs/action/GetPath", {"target_pose": target(0.5)})
    status, values = plan.result()
    assert status == SUCCEEDED and len(values["path"]["poses"]) > 3
    drive = send(ros, "/move_base_flex/exe_path", "mbf_msgs/action/ExePath", {"path": values["path"]})
    assert drive.result()[0] == SUCCEEDED


NEAR = {"poses": [target(0.0), target(0.2), target(0.4)]}


@pytest.mark.parametrize(
    ("name", "kind", "goal"),
    [
        ("/move_base_flex/get_path", "mbf_msgs/GetPath", {"target_pose": target(0.4)}),
        ("/move_base_flex/exe_path", "mbf_msgs/ExePath", {"path": NEAR}),
        ("/move_base_flex/recovery", "mbf_msgs/Recovery", {"behavior": "recovery"}),
        ("/move_base_flex/move_base", "mbf_msgs/MoveBase", {"target_pose": target(0.4)}),
        ("/compute_path_to_pose", "nav2_msgs/ComputePathToPose", {"goal": target(0.4)}),
        ("/compute_path_through_poses", "nav2_msgs/ComputePathThroughPoses", {"goals": [target(0.2), target(0.4)]}),
        ("/follow_path", "nav2_msgs/FollowPath", {"path": NEAR}),
        ("/navigate_to_pose", "nav2_msgs/NavigateToPose", {"pose": target(0.4)}),
        ("/navigate_through_poses", "nav2_msgs/NavigateThroughPoses", {"poses": [target(0.2), target(0.4)]}),
        ("/follow_waypoints", "nav2_msgs/FollowWaypoints", {"poses": [target(0.2), target(0.4)]}),
        ("/smooth_path", "nav2_msgs/SmoothPath", {"path": NEAR}),
    ],
)
def test_every_action_is_served(serving, connect, send, name, kind, goal):
    _, server = serving()
    status, values = send(connect(server.port), name, kind, goal).result()
    package, _, short = kind.partition("/")
    assert status == SUCCEEDED and name in ACTIONS
    assert set(values) == {field.name for field in fields_of(f"{package}/action/{short}_Result")}


def test_a_goal_is_canceled_while_it_runs_and_the_robot_stops(serving, connect, send):
    session, server = serving()
    session.controller.play(creep)
    goal = send(
        connect(server.port), "/move_base_flex/move_base", "mbf_msgs/action/MoveBase", {"target_pose": target(5)}
    )
    goal.feedback.wait()
    goal.cancel()
    status, values = goal.result()
    assert (status, values["outcome"]) == (CANCELED, MoveBaseOutcome.CANCELED)
    assert session.robot.command.is_stopped()


def test_two_clients_plan_in_two_slots_at_the_same_time(serving, connect, send):
    session, server = serving()
    session.controller.play(creep)
    one, two = connect(server.port), connect(server.port)
    driving = send(one, "/move_base_flex/move_base", "mbf_msgs/action/MoveBase", {"target_pose": target(5)})
    driving.feedback.wait()
    plan = {"target_pose": target(1), "concurrency_slot": 7}
    assert send(two, "/move_base_flex/get_path", "mbf_msgs/action/GetPath", plan).result()[0] == SUCCEEDED
    assert not driving.results.values
    driving.cancel()
    driving.result()


def test_a_newer_goal_of_another_client_takes_the_robot_over(serving, connect, send):
    session, server = serving()
    session.controller.play(creep)
    older = send(connect(server.port), "/navigate_to_pose", "nav2_msgs/action/NavigateToPose", {"pose": target(5)})
    older.feedback.wait()
    newer = send(connect(server.port), "/navigate_to_pose", "nav2_msgs/action/NavigateToPose", {"pose": target(6)})
    assert older.result()[0] == CANCELED
    newer.feedback.wait()
    newer.cancel()
    assert newer.result()[0] == CANCELED


def test_a_failure_of_navigation_is_a_result_with_outcome_and_text(serving, connect, send):
    session, server = serving(ScriptedSession(clock=WallClock(), planner_max_retries=0))
    session.planner.play(PlanResult(GetPathOutcome.NO_PATH_FOUND, "walls all around"))
    ros = connect(server.port)
    status, values = send(
        ros, "/move_base_flex/get_path", "mbf_msgs/action/GetPath", {"target_pose": target(1)}
    ).result()
    assert (status, values["outcome"]) == (ABORTED, GetPathOutcome.NO_PATH_FOUND)
    assert "walls all around" in values["message"] and values["path"]["poses"] == []
    status, values = send(
        ros, "/compute_path_to_pose", "nav2_msgs/action/ComputePathToPose", {"goal": target(1)}
    ).result()
    assert (status, values["error_code"]) == (ABORTED, 208)


@pytest.mark.parametrize("pose", [target(1, orientation={"w": 0.0}), target(float("nan")), target(None)])
def test_a_pose_that_means_nothing_is_an_invalid_goal(serving, connect, send, pose):
    session, server = serving()
    goal = send(connect(server.port), "/move_base_flex/move_base", "mbf_msgs/action/MoveBase", {"target_pose": pose})
    status, values = goal.result()
    assert (status, values["outcome"]) == (ABORTED, GetPathOutcome.INVALID_GOAL)
    assert "target_pose" in values["message"] and values["dist_to_goal"] is None
    assert not session.planner.requests


def test_a_path_that_means_nothing_is_an_invalid_path(serving, connect, send):
    session, server = serving()
    path = path_message(session.path_to(1.0), MessageContext())
    path["poses"][3]["pose"]["orientation"]["w"] = 0.0
    goal = send(connect(server.port), "/move_base_flex/exe_path", "mbf_msgs/action/ExePath", {"path": path})
    status, values = goal.result()
    assert (status, values["outcome"]) == (ABORTED, ExePathOutcome.INVALID_PATH)
    assert "poses[3]" in values["message"]


@pytest.mark.parametrize(
    ("name", "kind", "goal", "text"),
    [
        ("/dance", "dances/action/Waltz", {}, "there is no action '/dance'; known: /compute_path_through_poses, /"),
        (
            "/navigate_to_pose",
            "mbf_msgs/action/MoveBase",
            {},
            "the action '/navigate_to_pose': expected the type nav2_msgs/action",
        ),
        ("/navigate_to_pose", "nav2_msgs/action/NavigateToPose", {}, "the field 'pose' of"),
        (
            "/navigate_to_pose",
            "nav2_msgs/action/NavigateToPose",
            {"pose": target("far")},
            r"expected a float64, got 'far'",
        ),
    ],
)
def test_what_is_no_goal_of_its_action_fails_with_a_text(serving, connect, send, name, kind, goal, text):
    _, server = serving()
    assert text in send(connect(server.port), name, kind, goal).error()


def test_a_hundred_goals_leave_nothing_behind(serving, connect, send):
    session, server = serving()
    ros = connect(server.port)
    for _ in range(100):
        goal = send(ros, "/move_base_flex/get_path", "mbf_msgs/action/GetPath", {"target_pose": target(0.3)})
        assert goal.result()[0] == SUCCEEDED
    assert session.server.get_path.unfinished == []
    assert server._service.actions._running["/move_base_flex/get_path"] == []
    (client,) = server._visitors
    assert client.goals == {}


def test_a_goal_on_a_topic_drives_and_is_shown(serving, connect, answers):
    session, server = serving()
    session.controller.play(creep)
    ros, goals = connect(server.port), answers()
    roslibpy.Topic(ros, "/move_base_flex/current_goal", "geometry_msgs/PoseStamped").subscribe(goals)
    roslibpy.Topic(ros, "/goal_pose", "geometry_msgs/PoseStamped").publish(target(4.0))
    (shown,) = goals.wait()
    assert shown["pose"]["position"]["x"] == 4.0
    (handle,) = session.server.move_base.unfinished
    assert handle.goal.target_pose == Pose.planar(4.0, 0.0)
