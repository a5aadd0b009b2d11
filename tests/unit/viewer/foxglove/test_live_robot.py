"""A robot that no recorder of ours follows, live: where it is, what it sees and plans, and goals for it."""

import re
import socket
import threading
from contextlib import ExitStack

import numpy as np
import pytest

from mbf_abstract.access.foxglove import FoxgloveOptions, live_robot, parsed_address
from mbf_abstract.access.page_access import Role
from mbf_abstract.events import EventKind
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import MeshView
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock, unix_seconds
from mbf_abstract.time.sim_clock import SimClock
from terrain.viewer.foxglove.robot import SteeredRobot
from terrain.viewer.foxglove.robot_feed import MAX_VERTICES, RobotFeed

CONFIG = """
backend: costmap
max_vel_x: 2.0
global_costmap: {width: 8.0, height: 6.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: astar}]
controllers: [{name: follow, type: regulated_pure_pursuit}]
"""
POINT = {"header": {"frame_id": "/map"}, "point": {"x": 2.0, "y": 1.0, "z": 0.0}}


class LiveRobot:
    """A robot in real time that is served, and its only client."""

    def __init__(self, file, send):
        self.session = LoopbackSession(Pose.planar(1.0, 1.0), WallClock())
        self.notes = []
        self._file, self._send = file, send

    def __enter__(self):
        session = self.session
        self._closing = ExitStack()
        self._closing.enter_context(session)
        session.serve(*read_config(self._file), session.robot, session.transforms)
        send = self._send or session.navigator.send
        options = FoxgloveOptions(port=0)
        self.live = self._closing.enter_context(live_robot(options, session, send, "loopback", self.notes.append))
        return self

    def __exit__(self, *exc):
        self._closing.close()

    def address(self, role):
        return self.notes[0 if role is Role.STEER else 1].split()[-1]


@pytest.fixture
def robot(tmp_path):
    """Serve robots; all are closed with the test."""
    (tmp_path / "robot.yaml").write_text(CONFIG)
    with ExitStack() as closing:
        yield lambda send=None: closing.enter_context(LiveRobot(tmp_path / "robot.yaml", send))


def events(client, kind):
    return [one for one in client.messages.get("/events", []) if (one["kind"], one["source"]) == (kind, "move_base")]


def test_a_robot_is_shown_where_it_is_with_its_map_scans_and_plan_at_the_time_of_the_calendar(robot, client):
    served = robot()
    session, app = served.session, client(served)
    app.subscribe("/tf", "/map", "/scan", "/plan", "/motion", "/events", "/scene")
    body = app.newest("/tf").transforms[0]
    ends = np.array([[2.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    scan = RangeScan.of_rays("eye", np.zeros(3), ends, [True, True], session.clock.now())
    session.navigator.server.take_scan(scan)
    hit = np.frombuffer(app.newest("/scan").data, "<f4").reshape(-1, 3)
    app.publish("/clicked_point", POINT)
    app.until(lambda: events(app, "goal_finished"))

    assert app.operation("serverInfo")["name"] == "mbf loopback"
    assert (body.child_frame_id, body.translation.x, body.translation.y) == ("base_link", 1.0, 1.0)
    assert abs(app.stamps["/tf"][0] / 1e9 - unix_seconds()) < 3600.0
    np.testing.assert_allclose(hit, ends)
    assert (app.newest("/map").column_count, len(app.messages["/map"])) == (80, 1), "a map that stays is sent once"
    assert events(app, "goal_finished")[0]["data"]["outcome"] == 0
    assert app.newest("/plan").poses[-1].position.x == pytest.approx(2.0, abs=0.1)
    assert session.robot.pose.x == pytest.approx(2.0, abs=0.3)
    app.until(lambda: any(message["speed"] > 0.0 for message in app.messages["/motion"]))


def test_nothing_is_shown_before_the_robot_is_heard_and_what_happened_then_comes_with_it(tmp_path):
    (tmp_path / "robot.yaml").write_text(CONFIG)
    with LoopbackSession(Pose.planar(1.0, 1.0)) as session:
        server = session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
        feed = RobotFeed(session, "loopback")
        session.clock.sleep(0.1)
        session.transforms.clear()
        session.events.emit(EventKind.CUSTOM, "test", message="before")
        assert feed.part() is None
        session.transforms.set(Transform((3.0, 2.0, 0.0), parent="map", child="odom", stamp=session.clock.now()))
        session.transforms.set(Transform((0.0, 0.0, 0.0), parent="odom", child="base_link", stamp=session.clock.now()))
        part = feed.part()
        session.robot.publishes_odometry = False
        session.clock.sleep(10.0)
        session.transforms.set(Transform((3.0, 2.5, 0.0), parent="map", child="odom", stamp=session.clock.now()))
        session.transforms.set(Transform((0.0, 0.0, 0.0), parent="odom", child="base_link", stamp=session.clock.now()))
        again = feed.part()
        feed.close()

    assert part.poses[0, :2].tolist() == [3.0, 2.0] and len(part.grids) == 1 and not again.grids
    assert "before" in [event.data.get("message") for event in part.events]
    assert "before" not in [event.data.get("message") for event in again.events] and server.scan_listeners == []
    assert part.twists.tolist() == [[0.0, 0.0, 0.0]] and np.isnan(again.twists).all(), "nobody knows its velocity"


def test_goals_that_come_while_it_is_held_are_held_too(robot, client):
    served = robot()
    app = client(served)
    app.subscribe("/events")
    assert app.call("/pause")["success"]
    app.publish("/clicked_point", POINT)
    app.until(lambda: events(app, "goal_paused"))
    assert not events(app, "goal_finished")
    assert app.call("/resume")["success"]
    app.until(lambda: events(app, "goal_finished"))
    assert events(app, "goal_finished")[0]["data"]["outcome"] == 0


@pytest.fixture
def dead_client():
    """Connect to a server and never answer it, not even when it says goodbye."""
    with ExitStack() as closing:

        def connect(address):
            port, path = re.fullmatch(r"ws://127\.0\.0\.1:(\d+)(/.*)", address).groups()
            near = closing.enter_context(socket.create_connection(("127.0.0.1", int(port))))
            near.sendall(
                f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
            )
            assert b" 101 " in near.recv(100)

        yield connect


def test_at_the_end_the_robot_is_stopped_before_a_dead_client_is_waited_for(robot, client, dead_client, monkeypatch):
    served = robot()
    server, app = served.session.navigator.server, client(served)
    dead_client(served.address(Role.STEER))
    app.subscribe("/motion")
    app.publish("/clicked_point", POINT)
    app.until(lambda: any(message["speed"] > 0.0 for message in app.messages.get("/motion", [])))
    sockets = served.live._server
    stood, close = [], sockets.close
    monkeypatch.setattr(sockets, "close", lambda: (stood.append(server.runtime.gate.closed), close()))
    served.__exit__()

    assert stood == [True]
    assert sockets._loop.is_closed(), "it has not waited longer than its thread was waited for"


def test_a_server_that_is_closed_looks_at_nothing_and_listens_no_more_whatever_its_feed_does(robot, monkeypatch):
    served = robot()

    def fail():
        raise RuntimeError("the feed is damaged")

    parts = []
    monkeypatch.setattr(served.live._feed, "part", lambda: parts.append(threading.current_thread()))
    monkeypatch.setattr(served.live._feed, "close", fail)
    with pytest.raises(RuntimeError, match="damaged"):
        served.live.close()
    monkeypatch.undo()

    assert threading.current_thread() not in parts, "its feed is looked at on one thread only"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", served.live.port))


def test_times_are_those_of_a_clock_that_knows_the_calendar_even_after_it_was_set(tmp_path):
    class DatedSimClock(SimClock):
        epoch = 1000.0

    (tmp_path / "robot.yaml").write_text(CONFIG)
    with LoopbackSession(Pose.planar(1.0, 1.0), DatedSimClock()) as session:
        session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
        feed = RobotFeed(session, "loopback")
        session.clock.sleep(0.1)
        first = feed.part()
        session.clock.epoch = 5000.0
        session.events.emit(EventKind.CUSTOM, "test")
        second = feed.part()
        feed.close()
        now = session.clock.now()

    assert 1000.0 <= feed.began <= first.times[0] == pytest.approx(1000.0 + now)
    assert second.times[0] == second.events[-1].time == pytest.approx(5000.0 + now)


def test_while_nobody_is_there_scans_and_maps_are_left_out_and_meshes_that_are_too_large_always(tmp_path, monkeypatch):
    (tmp_path / "robot.yaml").write_text(CONFIG)
    with LoopbackSession(Pose.planar(1.0, 1.0)) as session:
        server = session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
        feed = RobotFeed(session, "loopback")
        session.clock.sleep(0.1)
        scan = RangeScan.of_rays("eye", np.zeros(3), np.eye(3), [True] * 3, session.clock.now())
        feed.is_watched = lambda: False
        feed._take_scan(scan)
        alone = feed.part()
        feed.is_watched = lambda: True
        feed._take_scan(scan)
        watched = feed.part()
        meshes = []
        for count in (MAX_VERTICES, MAX_VERTICES + 1):
            mesh = MeshView(np.zeros((count, 3)), np.zeros((1, 3), np.int32), np.zeros(count, np.float32))
            monkeypatch.setattr(server, "map_view", lambda name="", mesh=mesh: mesh)
            session.clock.sleep(10.0)
            meshes.append(len(feed.part().meshes))
        feed.close()

    assert (len(alone.scans), len(alone.grids), len(alone.times)) == (0, 0, 1)
    assert (len(watched.scans), len(watched.grids)) == (1, 1) and meshes == [1, 0]


def test_who_pauses_and_who_resumes_take_turns(robot):
    session = robot().session
    server, held = session.navigator.server, SteeredRobot(session, session.navigator.send)
    pauses, resumed = server.pause_all, threading.Event()
    resuming = threading.Thread(target=lambda: (held.hold(False), resumed.set()))

    def slow_pause():
        resuming.start()
        overtaken = resumed.wait(0.5)
        assert not overtaken, "the goals are paused after they were let go"
        return pauses()

    held.hold(True)
    server.pause_all = slow_pause
    try:
        held.keep_holding()
    finally:
        del server.pause_all
        resuming.join()


def test_a_fault_of_the_feed_is_noted_once_and_loses_nothing_that_waits(robot, client, monkeypatch):
    served = robot()
    server, app = served.session.navigator.server, client(served)
    looked = threading.Semaphore(0)

    def damaged(name=""):
        looked.release()
        raise RuntimeError("a damaged tile")

    monkeypatch.setattr(server, "map_view", damaged)
    feed = RobotFeed(served.session, "loopback")
    feed._take_scan(RangeScan.of_rays("eye", np.zeros(3), np.eye(3), [True] * 3, served.session.clock.now()))
    for _ in range(2):  # a look at each of the two maps
        with pytest.raises(RuntimeError):
            feed.part()
    assert len(feed.part().scans) == 1, "the scan has waited"
    feed.close()
    for _ in range(4):
        served.live._feed._next_map = 0.0
        assert looked.acquire(timeout=60.0)

    app.subscribe("/tf")
    assert app.newest("/tf")
    assert sum("damaged tile" in note for note in served.notes) == 1
    assert EventKind.FAULT not in [event.kind for event in served.session.memory.events]


def test_a_goal_that_is_not_taken_is_answered_with_the_reason(robot, client):
    def refuse(goal):
        raise ValueError("the navigator is not ready")

    app = client(robot(refuse))
    app.publish("/clicked_point", POINT)
    assert app.operation("status")["message"] == "the navigator is not ready"
    said = {"position": {"x": 2.0, "y": 1.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    app.publish("/initialpose", {**POINT, "pose": {"pose": said}}, number=8)
    assert "nothing here localises the robot" in app.operation("status")["message"]


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("127.0.0.1:9", ("127.0.0.1", 9)),
        (":0", ("127.0.0.1", 0)),
        ("robot", ("robot", 8765)),
        ("[::1]:80", ("::1", 80)),
        ("[::1]", ("::1", 8765)),
    ],
)
def test_addresses_are_read_with_and_without_port(text, address):
    assert parsed_address(text) == address


@pytest.mark.parametrize("text", ["robot:", "robot:x", "robot:70000", "robot:-1"])
def test_what_is_no_port_is_named(text):
    with pytest.raises(ValueError, match=f"--foxglove-at {text}: expected HOST:PORT"):
        parsed_address(text)
