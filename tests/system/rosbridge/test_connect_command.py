"""``mbf bridge connect`` from the terminal: its errors, how it proves a secret, and how it ends."""

import json
import signal
import socket
import subprocess
import sys
import threading

import pytest
from typer.testing import CliRunner

from mbf_abstract.access.page_access import PageAccess, Role
from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.cli import make_app
from mbf_abstract.geometry import Pose
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock
from mbf_ros.rosbridge.serving import BridgeOptions
from mbf_ros.rosbridge_robot.simulated_robot import serve_robot

CONNECT = [sys.executable, "-c", "from mbf_abstract.cli import main; main()", "bridge", "connect"]
CONFIG = """
backend: costmap
global_costmap: {width: 40.0, height: 8.0, resolution: 0.2, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 8.0, height: 8.0, resolution: 0.2, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
"""


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG)
    return file


@pytest.fixture
def robot(config):
    """A robot behind a server that asks for a token; it stops by itself only after 10 s."""
    driver = config.with_name("driver.yaml")
    driver.write_text(f"command_timeout: 10.0\n{CONFIG}")
    with LoopbackSession(Pose.planar(1.0, 4.0), WallClock()) as session:
        session.serve(*read_config(driver), session.robot, session.transforms)
        access = PageAccess.by_token("127.0.0.1")
        with serve_robot(session, BridgeOptions(ServerOptions(access, port=0))) as server:
            token = next(token for token, role in access.roles.items() if role is Role.STEER)
            yield session, server.port, token


def connect(*arguments):
    return CliRunner().invoke(make_app(), ["bridge", "connect", *map(str, arguments)])


@pytest.fixture
def listening():
    """The port of a program that takes connections and answers each with a text."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            near, _ = server.accept()
            with near:
                near.recv(4096)
                near.sendall(b"220 mail\r\n")

        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        yield server.getsockname()[1]
        thread.join(20)


def test_what_is_no_address_is_refused(config):
    for address in ("robot:9090", "http://robot:9090", "ws://", "ws://robot:port"):
        result = connect(address, config)
        assert result.exit_code == 2
        assert f"expected the address of a rosbridge such as ws://robot:9090, got '{address}'" in result.output


def test_mistakes_of_the_configuration_are_found_before_anything_is_connected(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG.replace("straight_line", "crooked_line"))
    result = connect("ws://127.0.0.1:1", file)
    assert result.exit_code == 2 and "planners[0].type" in result.output and "cannot connect" not in result.output


def test_a_robot_that_cannot_be_reached_is_named_with_what_to_do(config):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    refused = connect(f"ws://127.0.0.1:{port}", config)
    assert refused.exit_code == 2
    assert f"cannot connect to ws://127.0.0.1:{port}: nothing listens there; is the robot's server" in refused.output
    unknown = connect("ws://robot.invalid:9090", config)
    assert unknown.exit_code == 2 and "the name of the robot is not known" in unknown.output


def test_what_is_no_rosbridge_is_named(config, listening):
    result = connect(f"ws://127.0.0.1:{listening}", config)
    assert result.exit_code == 2 and "what answers there is no WebSocket" in result.output


def test_a_wrong_token_in_the_address_is_refused_and_not_printed(config, robot):
    result = connect(f"ws://127.0.0.1:{robot[1]}/not-the-token/", config)
    assert result.exit_code == 2
    assert "access is refused (HTTP 403: the token in the address is wrong)" in result.output
    assert "--secret-file" in result.output and "not-the-token" not in result.output


REFUSALS = {"not it": "the secret is wrong, or the calendars differ", "": "if it asks for auth, give --secret-file"}


@pytest.mark.parametrize("secret", REFUSALS)
@pytest.mark.parametrize("time", ["calendar", "odom"])
def test_a_secret_that_is_wrong_or_missing_ends_the_command_with_one_text(config, robot, tmp_path, secret, time):
    file = tmp_path / "secret"
    file.write_text(secret)
    command = [*CONNECT, f"ws://127.0.0.1:{robot[1]}", str(config), "--secret-file", str(file), "--time", time]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert ended.returncode == 2
    assert REFUSALS[secret] in ended.stderr and "1008" in ended.stderr and "warning" not in ended.stderr


@pytest.mark.parametrize(("signal_", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 128 + signal.SIGTERM)])
def test_it_proves_the_secret_drives_and_ends_with_zero(config, robot, raw, tmp_path, signal_, code):
    session, port, token = robot
    secret = tmp_path / "secret"
    secret.write_text(f"{token}\n")
    command = [*CONNECT, f"ws://127.0.0.1:{port}", str(config), "--secret-file", str(secret), "--max-silence", "20"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        lines = iter(process.stdout.readline, "")
        assert any("move_base_flex is ready" in line for line in lines)
        client, driving = raw(port, path=f"/{token}/"), False
        client.send(json.dumps({"op": "advertise", "topic": "/goal_pose", "type": "geometry_msgs/PoseStamped"}))
        goal = {"header": {"frame_id": "map"}, "pose": {"position": {"x": 30.0, "y": 4.0}}}
        client.send(json.dumps({"op": "publish", "topic": "/goal_pose", "msg": goal}))
        while not driving:
            session.clock.sleep(0.01)
            driving = any(not command.is_stopped() for _, command in tuple(session.robot.commands))
        process.send_signal(signal_)
        assert process.wait(60) == code
        assert session.robot.commands[-1][1].is_stopped()
    finally:
        process.kill()
        process.communicate()
