"""The action of move_base as ROS 1 clients know it, spoken to by roslibpy's actionlib client."""

import pytest
import roslibpy
from roslibpy.ros1 import actionlib

from tests.system.rosbridge.conftest import creep

PREEMPTED, SUCCEEDED, ABORTED, REJECTED = 2, 3, 4, 5


def goal_message(x, **orientation):
    pose = {"position": {"x": x, "y": 0.0, "z": 0.0}, "orientation": {"w": 1.0, **orientation}}
    return {"target_pose": {"header": {"frame_id": "map", "seq": 3, "stamp": {"secs": 0, "nsecs": 0}}, "pose": pose}}


@pytest.fixture
def client(connect):
    made = []

    def make(port):
        made.append(actionlib.ActionClient(connect(port), "/move_base", "move_base_msgs/MoveBaseAction"))
        return made[-1]

    yield make
    for one in made:
        one.dispose()


@pytest.fixture
def sent(answers):
    """A goal, its feedback, and a function that waits for its status and text."""

    def send(client, message):
        goal = actionlib.Goal(client, roslibpy.Message(message))
        feedback, ended = answers(), answers()
        goal.on("feedback", feedback)
        goal.on("status", lambda status: ended(status) if status["status"] > 1 else None)
        goal.send()
        return goal, feedback, ended

    return send


def test_a_goal_arrives(serving, client, sent):
    session, server = serving()
    goal, feedback, _ = sent(client(server.port), goal_message(0.6))
    assert goal.wait(20) == {}
    assert session.robot.pose.x > 0.3
    assert feedback.wait()[0]["base_position"]["header"]["stamp"]["secs"] > 1_500_000_000


def test_a_goal_is_canceled(serving, client, sent):
    session, server = serving()
    session.controller.play(creep)
    goal, feedback, ended = sent(client(server.port), goal_message(5.0))
    feedback.wait()
    goal.cancel()
    assert ended.wait_for(lambda status: status["status"] == PREEMPTED)["text"].startswith("CANCELED")
    assert session.robot.command.is_stopped()


def test_a_pose_that_means_nothing_is_rejected(serving, client, sent):
    _, server = serving()
    _, _, ended = sent(client(server.port), goal_message(1.0, w=0.0))
    assert "is not a rotation" in ended.wait_for(lambda status: status["status"] == REJECTED)["text"]
