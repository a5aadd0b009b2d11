"""``roslib`` 2.1 of npm, as web pages use it, with our rosbridge server."""

import pytest

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session

pytestmark = pytest.mark.timeout(600, func_only=True)  # the packages may have to be installed first
SUCCEEDED, PREEMPTED, REJECTED = 3, 2, 5  # of actionlib
CANCELED = "GoalError: Action was canceled"  # roslib's text


@pytest.fixture
def session():
    with ScriptedSession(clock=WallClock()) as session:
        yield session


@pytest.fixture
def page(session, start):
    """Start a case of ``roslib.mjs`` that is a client of the session."""
    with serve_session(session, BridgeOptions(ServerOptions(port=0))) as server:
        yield lambda case: start("roslib.mjs", server.port, case)


@pytest.fixture
def creeping(session):
    """A robot that never arrives."""
    session.controller.play(lambda request: ControlResult(ExePathOutcome.SUCCESS, "driving", Twist.planar(0.02)))


def test_a_page_hears_the_robot_and_other_pages_and_sends_a_goal_on_a_topic(page):
    said = page("topics").value()
    assert said["heard"] == {"data": "hello"} and said["frame"] == "base_link"
    assert set(said["frames"]) <= {"odom", "base_link"} and said["end"] == pytest.approx(0.6)


def test_services_and_parameters_are_called_and_what_is_there_is_listed(page, session):
    said = page("services").value()
    assert (said["paused"], said["resumed"]) == (True, True)
    assert "there is no service '/dance'" in said["unknown"]
    assert said["patience"] == 12.5 == session.server.runtime.parameters.controller_patience
    assert {"/tf", "/odom", "/cmd_vel"} <= set(said["topics"]) and "/rosapi/topics" in said["services"]
    assert said["nodes"] == ["/move_base_flex"] and "/navigate_to_pose" in said["actions"]
    assert said["type"] == "nav_msgs/msg/Path"
    assert said["fields"]["pose"]["orientation"]["w"] == "float64"


def test_goals_of_both_vocabularies_arrive_with_feedback(page, session):
    said = page("goals").value()
    assert said["distance"] <= 0.5 and said["moved"]["outcome"] == MoveBaseOutcome.SUCCESS
    assert said["navigated"] == {"error_code": 0, "error_msg": ""}
    assert session.robot.pose.x > 0.5


def test_one_goal_or_all_are_canceled_while_they_run_and_the_robot_stops(page, session, creeping):
    one, every = page("cancel").value()
    assert one["failure"].startswith(CANCELED) and every["failure"].startswith(CANCELED)
    assert session.robot.command.is_stopped()


def test_a_second_slot_plans_beside_the_drive_and_a_newer_goal_takes_the_robot_over(page, creeping):
    said = page("slots").value()
    assert said["planned"] == GetPathOutcome.SUCCESS
    assert said["end"]["failure"].startswith(CANCELED) and "preempted by a new goal" in said["end"]["failure"]
    assert said["newer"]["failure"].startswith(CANCELED)


def test_a_pose_that_means_nothing_and_an_action_that_is_not_there_fail_with_a_text(page, session):
    nonsense, unknown = page("refused").value()
    assert str(int(GetPathOutcome.INVALID_GOAL)) in nonsense["failure"] and "is not a rotation" in nonsense["failure"]
    assert "there is no action '/dance'" in unknown["failure"]
    assert not session.planner.requests


def test_a_goal_of_ros_1_arrives_with_feedback(page, session):
    said = page("actionlib").value()
    assert said == {"frame": "map", "status": SUCCEEDED, "result": {}}
    assert session.robot.pose.x > 0.3


def test_a_goal_of_ros_1_is_canceled_or_rejected_with_a_text(page, session, creeping):
    status, text, refused, why = page("actionlib_cancel").value()
    assert (status, refused) == (PREEMPTED, REJECTED)
    assert text.startswith("CANCELED") and "is not a rotation" in why
    assert session.robot.command.is_stopped()


def test_an_action_that_one_page_offers_is_used_by_another(page):
    left, parked, canceled = page("offered").value()
    assert (left, parked) == ({"left": 2.0}, {"result": {"bay": 3}})
    assert canceled["failure"] == f'{CANCELED}: {{"bay":-1}}'


def test_the_robot_is_stopped_when_the_page_of_its_goal_is_killed_and_the_next_goal_works(page, session, creeping):
    driving = page("drive")
    assert driving.line() == "driving"
    (handle,) = session.server.move_base.unfinished
    driving.kill()
    assert handle.wait(60).outcome == MoveBaseOutcome.CANCELED
    assert session.robot.command.is_stopped()
    session.controller.play(session.controller.follow)
    assert session.server.move_base.send(MoveBaseGoal(Pose.planar(0.6, 0.0))).wait(60).outcome == 0
