"""``mbf bridge serve`` from the terminal: what it prints, how it ends, and what it refuses."""

import json
import signal
import socket
import subprocess
import sys

import pytest
from typer.testing import CliRunner
from websockets.exceptions import ConnectionClosed

from mbf_abstract.cli import make_app

MBF = [sys.executable, "-c", "from mbf_abstract.cli import main; main()", "bridge", "serve"]
CONFIG = """
backend: costmap
global_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: dijkstra}]
"""


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG)
    return file


@pytest.mark.parametrize(("signal_", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 128 + signal.SIGTERM)])
def test_it_serves_until_it_is_interrupted_and_says_farewell(config, raw, ask, signal_, code):
    options = ["--port", "0", "--token", "--foxglove", "--foxglove-at", "127.0.0.1:0"]
    process = subprocess.Popen([*MBF, str(config), *options], stdout=subprocess.PIPE, text=True)
    try:
        lines = [process.stdout.readline() for _ in range(6)]
        assert lines[0].startswith("page: http://127.0.0.1:") and lines[2].startswith("page, to watch only: http://")
        assert "the robot is the client that publishes /odom and /tf" in lines[4]
        port, _, path = lines[1].strip().removeprefix("rosbridge: ws://127.0.0.1:").partition("/")
        operation = {"op": "call_service", "service": "/rosapi/nodes"}
        socket = raw(int(port), path=f"/{path}")
        assert ask(socket, operation, "service_response")["values"] == {"nodes": ["/move_base_flex"]}
        app_port, _, app_path = lines[5].split()[-1].removeprefix("ws://127.0.0.1:").partition("/")
        app = raw(int(app_port), path=f"/{app_path}", subprotocols=["foxglove.sdk.v1"])
        assert json.loads(app.recv(timeout=60))["name"] == "mbf robot"
        process.send_signal(signal_)
        with pytest.raises(ConnectionClosed, match="1001"):  # going away
            ask(socket, operation, "nothing")
        assert process.wait(60) == code
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--sensor", "/scan"], "--sensor: expected TOPIC:TYPE=SOURCE with one of the types LaserScan"),
        (["--sensor", "/scan:Image=camera"], "got '/scan:Image=camera'"),
        (["--robot-only"], "--robot-only is for scenarios: the robot of a navigation file is a client itself"),
        (["--seed", "3"], "--backend and --seed are for scenarios"),
        (["--robot-only", "--foxglove"], "--foxglove shows a navigator, which --robot-only leaves out"),
        (["--foxglove-read-only"], "it goes with --foxglove only"),
        (["--foxglove", "--foxglove-at", "here:there"], "expected HOST:PORT with a port"),
        (["--host", "192.0.2.1", "--port", "0"], "cannot listen at 192.0.2.1:0"),
    ],
)
def test_what_cannot_be_served_is_refused_with_one_text(config, options, text):
    result = CliRunner().invoke(make_app(), ["bridge", "serve", str(config), *options])
    assert result.exit_code == 2
    assert text in result.output


def test_a_port_that_is_taken_is_named_in_a_few_words(config):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = CliRunner().invoke(make_app(), ["bridge", "serve", str(config), "--port", str(port)])
    assert result.output.endswith(f"error: cannot listen at 127.0.0.1:{port}: address already in use\n")


def test_what_is_neither_file_nor_scenario_is_named(tmp_path):
    result = CliRunner().invoke(make_app(), ["bridge", "serve", str(tmp_path / "nothing.yaml")])
    assert result.exit_code == 2 and "nothing.yaml" in result.output
