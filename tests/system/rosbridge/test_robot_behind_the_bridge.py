"""A robot that is a client: it publishes tf, odometry and scans, and drives as ``/cmd_vel`` says."""

import json
import math
import threading
from contextlib import suppress

import pytest
from websockets.exceptions import ConnectionClosed

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.config.configuration import Config
from mbf_abstract.config.navigation_parameters import NavigationParameters
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.session import NavigationSession
from mbf_abstract.testing.scripted_session import SCRIPTED, MapFreeServer, _spec
from mbf_abstract.time.clock import WallClock
from mbf_ros.ros2.robot import Frames
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session
from mbf_ros.rosbridge_robot.topic_robot import TopicRobot

PERIOD = 0.05
TYPES = {"/tf": "tf2_msgs/TFMessage", "/odom": "nav_msgs/Odometry", "/scan": "sensor_msgs/LaserScan"}
SCAN = {
    "header": {"frame_id": "base_link"},
    "angle_min": 0.0,
    "angle_increment": 0.1,
    "range_max": 5.0,
    "ranges": [2.0],
}


@pytest.fixture
def session_and_robot(tmp_path):
    session, transforms = NavigationSession(WallClock()), TransformBuffer()
    robot = TopicRobot(transforms, session.clock, Frames("map", "base_link"), lambda: 1.0)
    specs = tuple(_spec(name, plugin) for name, plugin in SCRIPTED.items())
    parameters = NavigationParameters(tf_timeout=60.0, command_timeout=0.3, controller_patience=3.0)
    config = Config("none", tmp_path / "scripted.yaml", parameters, specs)
    session.serve(MapFreeServer, config, robot, transforms)
    return session, robot


class RemoteRobot:
    """A robot at the other end of a WebSocket, on a thread of its own."""

    def __init__(self, socket):
        self.socket, self.x, self.yaw, self.commands = socket, 0.0, 0.0, []
        self.publishes = {"/tf", "/odom", "/scan"}
        self._ended = threading.Event()
        for topic, kind in TYPES.items():
            self.send(op="advertise", topic=topic, type=kind)
        self.send(op="subscribe", topic="/cmd_vel", type="geometry_msgs/Twist")
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def send(self, **operation):
        self.socket.send(json.dumps(operation))

    def end(self):
        self._ended.set()
        self._thread.join(20)

    def _run(self):
        with suppress(ConnectionClosed):
            self._drive()
        with suppress(ConnectionClosed):  # sending failed first: what came before the end is still to be read
            while not self._ended.is_set():
                self._newest_speed(0.0)

    def _drive(self):
        speed = 0.0
        while not self._ended.is_set():
            speed = self._newest_speed(speed)
            self.x += speed * PERIOD
            header, rotation = {"frame_id": "/map"}, {"z": math.sin(self.yaw / 2), "w": math.cos(self.yaw / 2)}
            body = {"translation": {"x": self.x, "y": 0.0}, "rotation": rotation}
            transform = {"header": header, "child_frame_id": "base_link", "transform": body}
            odometry = {"header": header, "twist": {"twist": {"linear": {"x": speed}}}}
            messages = {"/tf": {"transforms": [transform]}, "/odom": odometry, "/scan": SCAN}
            for topic, message in messages.items():
                if topic in self.publishes:
                    self.send(op="publish", topic=topic, msg=message)

    def _newest_speed(self, speed):
        """Speed of the last command that comes within a period, which this call takes."""
        try:
            answer = json.loads(self.socket.recv(timeout=PERIOD))
        except TimeoutError:
            return speed
        if answer["op"] == "publish":
            speed = answer["msg"]["linear"]["x"]
            self.commands.append(speed)
        return speed


@pytest.fixture
def remote(session_and_robot, serving, raw):
    session, robot = session_and_robot
    _, server = serving(session, robot, sensors={"/scan": ("sensor_msgs/LaserScan", "scan")})
    made = RemoteRobot(raw(server.port))
    known = threading.Event()
    session.navigator.server.runtime.transforms.when_available("map", "base_link", None, lambda _: known.set())
    assert known.wait(20)
    yield session, made
    made.end()


def test_it_drives_to_the_goal(remote):
    session, robot = remote
    result = session.navigator.send(MoveBaseGoal(Pose.planar(0.6, 0.0))).wait(20)
    assert result.success and robot.x > 0.3
    assert max(robot.commands) > 0.1


@pytest.mark.parametrize("lost", TYPES)
def test_when_it_falls_silent_it_is_stopped_long_before_tf_timeout_and_the_goal_ends(remote, lost):
    session, robot = remote
    driving = threading.Event()
    handle = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
    handle.add_feedback_callback(lambda _: driving.set())
    assert driving.wait(20)
    robot.publishes.discard(lost)
    result = handle.wait(20)
    assert result.outcome_name == "TF_ERROR" and not result.success
    assert session.navigator.server.runtime.gate.last_command.is_stopped()


def test_when_the_server_ends_zero_is_the_last_that_it_hears(session_and_robot, raw):
    session, driver = session_and_robot
    with session, serve_session(session, BridgeOptions(ServerOptions(port=0)), driver) as server:
        robot, driving, known = RemoteRobot(raw(server.port)), threading.Event(), threading.Event()
        session.navigator.server.runtime.transforms.when_available("map", "base_link", None, lambda _: known.set())
        assert known.wait(20)
        handle = session.navigator.send(MoveBaseGoal(Pose.planar(50.0, 0.0)))
        handle.add_feedback_callback(lambda feedback: driving.set() if feedback.last_command.vx > 0.1 else None)
        assert driving.wait(20)
    robot._thread.join(20)
    assert max(robot.commands) > 0.1 and robot.commands[-1] == 0.0


def test_wrong_transforms_are_refused_with_a_text(session_and_robot, serving, raw, ask):
    session, robot = session_and_robot
    _, server = serving(session, robot)
    loop = {"header": {"frame_id": "odom"}, "child_frame_id": "odom", "transform": {}}
    message = {"op": "publish", "topic": "/tf", "msg": {"transforms": [loop]}}
    assert "a frame in itself" in ask(raw(server.port), message, "status")["msg"]


def test_its_scans_reach_the_map_by_the_configured_source(session_and_robot, serving, raw, ask):
    session, robot = session_and_robot
    seen = []
    session.navigator.server.scan_listeners.append(seen.append)
    _, server = serving(session, robot, sensors={"/front": ("sensor_msgs/LaserScan", "lidar")})
    scan = {
        "header": {"frame_id": "laser"},
        "angle_min": 0.0,
        "angle_increment": 0.1,
        "range_max": 5.0,
        "ranges": [2.0],
    }
    socket = raw(server.port)
    socket.send(json.dumps({"op": "publish", "topic": "/front", "msg": scan}))
    ask(socket, {"op": "call_service", "service": "/rosapi/topics"}, "service_response")
    assert [(one.source, one.frame_id, one.points.tolist()) for one in seen] == [("lidar", "laser", [[2.0, 0.0, 0.0]])]
    assert seen[0].stamp == pytest.approx(session.clock.now(), abs=5.0)
