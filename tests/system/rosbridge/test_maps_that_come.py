"""Maps that come over rosbridge: to a served navigator from its clients, to a connected one from its robot."""

import json
from contextlib import ExitStack

import pytest

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.geometry import Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session
from mbf_ros.rosbridge_robot.navigator import connect_navigator
from mbf_ros.rosbridge_robot.options import RobotOptions
from mbf_ros.rosbridge_robot.simulated_robot import serve_robot
from tests.system.rosbridge.conftest import ROBOT, WITHIN

CONFIG = f"""{ROBOT}
backend: costmap
planner_max_retries: 0
global_costmap: &map {{layers: [{{name: walls, type: static}}], walls: {{map_topic: /map}}}}
local_costmap: *map
planners: [{{name: shortest, type: straight_line}}]
"""
MISSING = "layer 'walls': no map has come on /map yet"


def grid(width, height, **fields):
    info = {"resolution": 0.2, "width": width, "height": height}
    return {"header": {"frame_id": "/map"}, "info": info, "data": [0] * (width * height), **fields}


def say(socket, **operation):
    socket.send(json.dumps(operation))


def wait_until(clock, holds):
    """Wait for a state that changes by itself and tells nobody."""
    deadline = clock.now() + WITHIN
    while not holds():
        assert clock.now() < deadline
        clock.sleep(0.01)


def advertise(socket):
    say(socket, op="advertise", topic="/map", type="nav_msgs/OccupancyGrid", latch=True)


@pytest.fixture
def session(tmp_path):
    (tmp_path / "robot.yaml").write_text(CONFIG)
    with LoopbackSession(Pose.planar(1.0, 1.0), WallClock()) as session:
        session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
        yield session


def test_a_client_of_the_server_publishes_the_map_and_a_bad_one_is_answered_and_changes_nothing(session, raw, ask):
    navigator = session.navigator
    with serve_session(session, BridgeOptions(ServerOptions(port=0))) as server:
        assert navigator.get_path(Pose.planar(3.0, 1.0)).message == MISSING
        socket = raw(server.port)
        advertise(socket)
        say(socket, op="publish", topic="/map", msg=grid(40, 30))
        wait_until(session.clock, lambda: navigator.get_path(Pose.planar(3.0, 1.0)).success)
        bad = {"op": "publish", "topic": "/map", "msg": grid(40, 31, data=[0] * 3)}
        answer = ask(socket, bad, "status")
        assert (answer["level"], "/map" in answer["msg"]) == ("error", True)
        assert "data: expected 40 x 31 cells, at least one, got 3" in answer["msg"]
        wall = {"x": 4, "y": 4, "width": 2, "height": 2, "data": [100] * 4}
        say(socket, op="publish", topic="/map_updates", msg=wall)
        blocked = GetPathOutcome.BLOCKED_START
        wait_until(session.clock, lambda: navigator.get_path(Pose.planar(3.0, 1.0)).outcome == blocked)
        assert navigator.server.map_view().costs.shape == (30, 40)


def test_a_connected_navigator_waits_for_the_map_of_its_robot_and_then_drives(tmp_path, raw):
    config, driver = tmp_path / "robot.yaml", tmp_path / "driver.yaml"
    config.write_text(CONFIG)
    size = "width: 8.0, height: 8.0"
    driver.write_text(f"{ROBOT}\nbackend: costmap\nglobal_costmap: {{{size}}}\nlocal_costmap: {{{size}}}\n")
    with ExitStack() as closing:
        session = closing.enter_context(LoopbackSession(Pose.planar(1.0, 1.0), WallClock()))
        session.serve(*read_config(driver), session.robot, session.transforms)
        server = closing.enter_context(serve_robot(session, BridgeOptions(ServerOptions(port=0))))
        socket = raw(server.port)
        options = RobotOptions(max_silence=10.0)
        made = closing.enter_context(connect_navigator(f"ws://127.0.0.1:{server.port}", config, options))
        wait_until(session.clock, lambda: made.problem() == MISSING)
        advertise(socket)
        say(socket, op="publish", topic="/map", msg=grid(40, 30))
        wait_until(session.clock, lambda: not made.problem())
        assert made.session.navigator.go_to(Pose.planar(2.0, 1.0)).success
        assert session.robot.pose.distance_to(Pose.planar(2.0, 1.0)) < 0.3
