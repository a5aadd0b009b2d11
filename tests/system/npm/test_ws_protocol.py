"""``@foxglove/ws-protocol`` 0.8 of npm, the client of Foxglove's open apps, with our live server."""

import base64

import pytest
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from mbf_abstract.access.foxglove import FoxgloveOptions, live_robot
from mbf_abstract.geometry import Pose
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import WallClock, unix_seconds
from terrain.viewer.foxglove.protocol import SUBPROTOCOLS
from terrain.viewer.logs.run_messages import TOPICS

pytestmark = pytest.mark.timeout(600, func_only=True)  # the packages may have to be installed first
SIZE = "width: 8.0, height: 6.0, layers: [{name: area, type: keepout}], area: {zones: []}"
CONFIG = f"""
backend: costmap
global_costmap: {{{SIZE}}}
local_costmap: {{{SIZE}}}
planners: [{{name: shortest, type: straight_line}}]
controllers: [{{name: follow, type: follow_path}}]
"""


@pytest.fixture
def session(tmp_path):
    file = tmp_path / "robot.yaml"
    file.write_text(CONFIG)
    with LoopbackSession(Pose.planar(1.0, 1.0), WallClock()) as session:
        session.serve(*read_config(file), session.robot, session.transforms)
        yield session


@pytest.fixture
def app(session, start):
    """Run a case of ``ws_protocol.mjs`` as a client of the session; returns its value."""
    notes = []
    with live_robot(FoxgloveOptions(port=0), session, session.navigator.send, "loopback", notes.append):

        def run(case, subprotocol="foxglove.sdk.v1"):
            said = start("ws_protocol.mjs", notes[0].split()[-1], subprotocol, case).value()
            assert said["errors"] == []
            return said["value"]

        yield run


def decoded(shown):
    channel = shown["channel"]
    data = base64.b64decode(channel["schema"])
    schema = Schema(id=1, data=data, encoding="protobuf", name=channel["schemaName"])
    return DecoderFactory().decoder_for(channel["encoding"], schema)(base64.b64decode(shown["payload"]))


@pytest.mark.parametrize("subprotocol", SUBPROTOCOLS)
def test_an_app_is_shown_the_robot_and_its_map_by_the_advertised_schemas(app, subprotocol):
    said = app("watch", subprotocol)
    assert said["name"] == "mbf loopback" and set(said["topics"]) == set(TOPICS)
    assert {"clientPublish", "parameters", "services", "time"} <= set(said["capabilities"])
    body = decoded(said["shown"]["/tf"]).transforms[0]
    assert (body.child_frame_id, body.translation.x, body.translation.y) == ("base_link", 1.0, 1.0)
    assert decoded(said["shown"]["/map"]).column_count == 80
    assert decoded(said["shown"]["/scene"]).entities
    assert abs(said["shown"]["/tf"]["seconds"] - unix_seconds()) < 3600.0


def test_a_clicked_point_is_a_goal_whose_drive_is_seen(app, session):
    assert app("steer") == 0
    assert session.robot.pose.x == pytest.approx(2.0, abs=0.3)


def test_a_point_in_another_frame_is_answered_with_a_status(app):
    assert "got 'odom': choose it as display frame" in app("refused")


def test_services_hold_the_robot_let_it_go_on_and_cancel_its_goals(app):
    assert [answer["success"] for answer in app("services")] == [True, True, True]


def test_parameters_are_changed_and_read(app, session):
    wanted = [{"name": "planner_patience", "value": 7.5}]
    assert app("parameters") == [wanted, wanted]
    assert session.navigator.server.runtime.parameters.planner_patience == 7.5
