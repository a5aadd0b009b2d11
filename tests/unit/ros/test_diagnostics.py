"""The state of a navigator as a DiagnosticArray."""

import pytest

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.plugins import PluginKind
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.messages.diagnostics import Level, diagnostics
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import completed

CONFIG = """
backend: costmap
global_costmap: {width: 4.0, height: 4.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 4.0, height: 4.0, layers: [{name: seen, type: obstacle}], seen: {sources: {scan: {}}}}
planners: [{name: shortest, type: dijkstra}]
controllers: [{name: follow, type: follow_path}]
"""


@pytest.fixture
def server(tmp_path):
    (tmp_path / "robot.yaml").write_text(CONFIG)
    session = LoopbackSession(Pose.planar(1.0, 1.0), SimClock())
    session.serve(*read_config(tmp_path / "robot.yaml"), session.robot, session.transforms)
    with session:
        yield session.navigator.server


def states(server, **inputs):
    message = diagnostics(server, inputs, 1.0, MessageContext())
    completed("diagnostic_msgs/DiagnosticArray", message)
    assert message["header"]["stamp"]["sec"] == 1
    return {one["name"].removeprefix("move_base_flex: "): one for one in message["status"]}


def test_inputs_that_come_are_ok_and_silent_ones_are_stale(server):
    found = states(server, odom="", scan="no message has come on scan yet")
    assert (found["input odom"]["level"], found["input odom"]["message"]) == (Level.OK, "comes")
    assert found["input scan"]["level"] == Level.STALE and "yet" in found["input scan"]["message"]


def test_each_map_says_whether_it_is_fresh_and_which_sensors_it_waits_for(server):
    found = states(server)
    assert found["map global_costmap"]["level"] == Level.OK
    assert found["map local_costmap"]["level"] == Level.STALE
    assert "'scan' has not sent anything yet" in found["map local_costmap"]["message"]
    values = {one["key"]: one["value"] for one in found["map local_costmap"]["values"]}
    assert values == {"frame": "map", "layers": "seen", "sources": "scan"}


def test_each_plugin_says_who_uses_it_and_why_it_is_not_available(server):
    found = states(server)
    assert {name for name in found if name.split()[0] in ("planner", "controller")} == {
        "planner 'shortest'",
        "controller 'follow'",
    }
    assert found["planner 'shortest'"]["message"] == "ready"
    plugin = server.plugins.get(PluginKind.PLANNER, "shortest")
    assert plugin.acquire("goal 7", lambda: True)
    assert states(server)["planner 'shortest'"]["message"] == "in use by goal 7"
    plugin.quarantine("goal 7", "its call hangs")
    bad = states(server)["planner 'shortest'"]
    assert (bad["level"], bad["message"]) == (Level.ERROR, "its call hangs")
    plugin.release("goal 7")
    assert states(server)["planner 'shortest'"]["level"] == Level.OK


def test_the_gate_says_who_drives_and_that_it_is_closed(server):
    assert states(server)["velocity gate"]["message"] == "nobody drives"
    lease = server.runtime.gate.acquire("follow")
    lease.send(Twist((0.1, 0.0, 0.0)))
    gate = states(server)["velocity gate"]
    values = {one["key"]: one["value"] for one in gate["values"]}
    assert gate["message"] == "driven by follow" and values["last_command"] == "0.1 0 0"
    server.runtime.gate.close("the end")
    assert states(server)["velocity gate"]["level"] == Level.ERROR
