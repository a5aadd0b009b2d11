"""Topics, services and rosapi, seen by roslibpy clients."""

import base64
import json

import numpy as np
import pytest
import roslibpy

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import GetPathGoal, MoveBaseGoal
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock


def listen(answers, ros, name, kind, **fields):
    got = answers()
    topic = roslibpy.Topic(ros, name, kind, **fields)
    topic.subscribe(got)
    return got


def goal_to(x):
    return MoveBaseGoal(Pose.planar(x, 0.0))


def call(ros, name, kind, **request):
    return roslibpy.Service(ros, name, kind).call(roslibpy.ServiceRequest(request), timeout=20)


def test_a_simulated_robot_is_seen_in_tf_odometry_and_commands(serving, connect, answers):
    session, server = serving()
    ros = connect(server.port)
    tf, odom = listen(answers, ros, "/tf", "tf2_msgs/TFMessage"), listen(answers, ros, "/odom", "nav_msgs/Odometry")
    commands = listen(answers, ros, "/cmd_vel", "geometry_msgs/Twist")
    plan = listen(answers, ros, "/plan", "nav_msgs/Path")
    call(ros, "/rosapi/topics", "rosapi/Topics")  # the subscriptions are there when it answers
    session.server.move_base.send(goal_to(0.6)).wait(20)
    children = {t["child_frame_id"] for message in tf.wait(3) for t in message["transforms"]}
    assert children == {"odom", "base_link"}
    moving = odom.wait_for(lambda message: message["twist"]["twist"]["linear"]["x"] > 0.1)
    assert (moving["header"]["frame_id"], moving["child_frame_id"]) == ("odom", "base_link")
    assert moving["header"]["stamp"]["sec"] > 1_500_000_000
    commands.wait_for(lambda message: message["linear"]["x"] > 0.1)
    assert plan.wait()[0]["poses"][-1]["pose"]["position"]["x"] == pytest.approx(0.6)


def test_commands_are_stamped_where_that_is_asked_for(serving, connect, answers):
    _, server = serving(stamped_commands=True)
    commands = listen(answers, connect(server.port), "/cmd_vel", "geometry_msgs/TwistStamped")
    (first, *_) = commands.wait()
    assert first["header"]["frame_id"] == "base_link" and first["twist"]["linear"]["x"] == 0.0


def test_a_scan_is_seen_as_laser_scan_and_points_in_the_frame_of_the_sensor(serving, connect, answers):
    session, server = serving()
    ros = connect(server.port)
    scans = listen(answers, ros, "/scan", "sensor_msgs/LaserScan")
    clouds = listen(answers, ros, "/points", "sensor_msgs/PointCloud2")
    call(ros, "/rosapi/topics", "rosapi/Topics")  # both subscriptions are there when it answers
    ends = [(2.0, 0.01, 0.3), (0.0, 3.0, 0.3), (-5.0, 0.01, 0.3)]
    now = session.clock.now()
    session.server.take_scan(RangeScan.of_rays("lidar", (0, 0, 0.3), ends, [True, True, False], now))
    scan, cloud = scans.wait()[0], clouds.wait()[0]
    assert scan["header"]["frame_id"] == cloud["header"]["frame_id"] == "lidar"
    assert scan["ranges"][180] == pytest.approx(2.0, abs=1e-3) and scan["ranges"][270] == pytest.approx(3.0)
    assert scan["ranges"][0] is None and cloud["width"] == 2
    points = np.frombuffer(base64.b64decode(cloud["data"]), "<f4").reshape(-1, 3)
    np.testing.assert_allclose(points, [(2.0, 0.01, 0.0), (0.0, 3.0, 0.0)], atol=1e-6)


def test_where_a_client_says_that_a_simulated_robot_is_its_localisation_is_told(serving, connect, answers, raw, ask):
    session, said = ScriptedSession(clock=WallClock()), answers()
    session.on_initial_pose.append(said)
    _, server = serving(session)
    ros = connect(server.port)
    topic = roslibpy.Topic(ros, "/initialpose", "geometry_msgs/PoseWithCovarianceStamped")
    pose = {"position": {"x": 2.0, "y": 1.0}, "orientation": {"w": 1.0}}
    topic.publish({"header": {"frame_id": "/map"}, "pose": {"pose": pose}})
    (got,) = said.wait()
    assert (got.frame_id, got.x, got.y) == ("map", 2.0, 1.0)
    message = {"header": {"frame_id": "odom"}, "pose": {"pose": pose}}
    answer = ask(raw(server.port), {"op": "publish", "topic": "/initialpose", "msg": message}, "status")
    assert "expected an initial pose in the frame 'map', got 'odom'" in answer["msg"]


def test_clients_hear_each_other_through_the_server_and_late_ones_get_what_is_latched(serving, connect, answers):
    _, server = serving()
    one, two = connect(server.port), connect(server.port)
    heard = listen(answers, two, "/chatter", "std_msgs/String")
    call(two, "/rosapi/topics", "rosapi/Topics")
    roslibpy.Topic(one, "/chatter", "std_msgs/String", latch=True).publish({"data": "hello"})
    assert heard.wait() == [{"data": "hello"}]
    assert listen(answers, connect(server.port), "/chatter", "std_msgs/String").wait() == [{"data": "hello"}]


def test_names_without_their_slash_are_the_same_and_come_back_as_they_were_spelled(serving, connect, answers):
    _, server = serving()
    ros = connect(server.port)
    heard = listen(answers, ros, "chatter", "std_msgs/String")
    assert "/chatter" in call(ros, "rosapi/topics", "rosapi/Topics")["topics"]
    roslibpy.Topic(connect(server.port), "/chatter", "std_msgs/String").publish({"data": "hello"})
    assert heard.wait() == [{"data": "hello"}]


def test_every_message_of_a_burst_comes_unless_a_throttle_is_asked_for(serving, connect, answers):
    _, server = serving()
    one, two = connect(server.port), connect(server.port)
    slow = listen(answers, one, "/chatter", "std_msgs/String", throttle_rate=200)
    fast = listen(answers, two, "/chatter", "std_msgs/String", queue_length=100)
    for ros in (one, two):
        call(ros, "/rosapi/topics", "rosapi/Topics")  # its subscription is there when it answers
    sender = roslibpy.Topic(connect(server.port), "/chatter", "std_msgs/String")
    for number in range(50):
        sender.publish({"data": str(number)})
    slow.wait_for(lambda message: message["data"] == "49")
    assert [message["data"] for message in fast.wait(50)] == [str(number) for number in range(50)]
    assert len(slow.values) < 50


def test_events_of_the_framework_are_a_topic(serving, connect, answers):
    session, server = serving()
    ros = connect(server.port)
    events = listen(answers, ros, "/move_base_flex/events", "std_msgs/String")
    call(ros, "/rosapi/topics", "rosapi/Topics")
    session.server.get_path.send(GetPathGoal(Pose.planar(1.0, 0.0))).wait(20)
    last = events.wait_for(lambda message: json.loads(message["data"])["kind"] == "goal_finished")
    assert json.loads(last["data"])["data"]["outcome"] == 0
    recorded = [event.to_json() for event in session.memory.events if event.source != "rosbridge"]
    heard = [message["data"] for message in events.values]
    first = recorded.index(next(text for text in heard if text in recorded))
    assert [text for text in heard if text in recorded] == recorded[
        first : recorded.index(last["data"]) + 1
    ]  # none lost


def test_rosapi_names_topics_services_and_actions(serving, connect):
    _, server = serving()
    ros = connect(server.port)
    topics = call(ros, "/rosapi/topics", "rosapi/Topics")
    types = dict(zip(topics["topics"], topics["types"], strict=True))
    assert types["/cmd_vel"] == "geometry_msgs/msg/Twist" and types["/goal_pose"] == "geometry_msgs/msg/PoseStamped"
    assert "/move_base_flex/pause" in ros.get_services()
    assert "/navigate_to_pose" in call(ros, "/rosapi/action_servers", "rosapi/ActionServers")["action_servers"]
    assert ros.get_topic_type("/odom") == "nav_msgs/msg/Odometry"
    assert ros.get_topics_for_type("nav_msgs/Path") == ["/local_plan", "/plan"]
    assert ros.get_nodes() == ["/move_base_flex"]
    assert "/cmd_vel" in ros.get_node_details("/move_base_flex")["publishing"]
    assert ros.get_message_details("geometry_msgs/PoseStamped")["typedefs"][0]["fieldnames"] == ["header", "pose"]
    assert ros.get_time()["secs"] > 1_500_000_000


def test_parameters_are_read_and_changed_by_the_client_of_rosapi(serving, connect):
    session, server = serving()
    ros = connect(server.port)
    parameter = roslibpy.Param(ros, "/move_base_flex:controller_patience")
    assert parameter.get(timeout=20) == session.server.runtime.parameters.controller_patience
    parameter.set(2.5, timeout=20)
    assert session.server.runtime.parameters.controller_patience == 2.5
    with pytest.raises(roslibpy.core.ServiceException, match="controller_patience"):
        roslibpy.Param(ros, "/move_base_flex/controller_patience").set(-1.0, timeout=20)
    assert "/move_base_flex/controller_patience" in ros.get_params()


def test_pause_resume_and_cancel_all_are_services(serving, connect):
    session, server = serving()
    ros = connect(server.port)
    handle = session.server.move_base.send(goal_to(50.0))
    for name, paused in (("pause", True), ("resume", False)):
        assert call(ros, f"/move_base_flex/{name}", "std_srvs/srv/Trigger")["success"] is True
        assert handle.paused is paused
    call(ros, "/move_base_flex/cancel_all", "std_srvs/srv/Trigger")
    assert handle.wait(20).outcome_name == "CANCELED"


@pytest.mark.parametrize(
    ("name", "request_", "text"),
    [
        ("/dance", {}, "there is no service '/dance'; known: .*/move_base_flex/pause, "),
        ("/move_base_flex/check_pose_cost", {"current_pose": True}, "the field 'costmap'"),
        ("/move_base_flex/check_pose_cost", {"costmap": 1, "pose": 3}, "pose: expected an object"),
    ],
)
def test_a_service_that_cannot_answer_fails_with_a_text(serving, connect, name, request_, text):
    _, server = serving()
    with pytest.raises(roslibpy.core.ServiceException, match=text):
        call(connect(server.port), name, "", **request_)
