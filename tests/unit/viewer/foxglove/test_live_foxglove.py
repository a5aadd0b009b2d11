"""A real run, seen and steered by a real client of the protocol: what it shows, what it takes, and who is refused."""

import json
import math
import struct
from functools import partial

import pytest
from websockets.exceptions import InvalidStatus, NegotiationError

from mbf_abstract.access.foxglove import FoxgloveOptions
from mbf_abstract.access.page_access import Role
from mbf_abstract.access.web_socket_server import ServerError
from terrain.session.runner import RunOptions, run_scenario
from terrain.viewer.foxglove.live import LiveFoxglove
from terrain.viewer.foxglove.protocol import SUBPROTOCOLS
from terrain.viewer.logs.run_messages import TOPICS

HERE = {"header": {"frame_id": "map"}}
GOAL = {**HERE, "pose": {"position": {"x": 4.0, "y": 6.0, "z": 0.0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}}
ON_A_MESH = [topic for topic in TOPICS if topic not in ("/map", "/local_map", "/objects")]  # no layer tracks what moves


def finished(client):
    """Events of goals of move_base that have ended."""
    events = client.messages.get("/events", [])
    return [one for one in events if (one["kind"], one["source"]) == ("goal_finished", "move_base")]


def test_a_client_sees_every_topic_decodes_it_and_its_goal_is_driven_to(served, client):
    run = served(start=False)
    app = client(run)
    app.subscribe(*TOPICS)
    run.start()

    app.until(lambda: finished(app))
    app.publish("/move_base_simple/goal", GOAL)
    app.until(lambda: len(finished(app)) == 2)
    app.until(lambda: len(app.messages["/plan"]) > 1)

    assert sorted(app.messages) == sorted(ON_A_MESH)
    assert [one["data"]["outcome"] for one in finished(app)] == [0, 0]
    goal = app.messages["/plan"][-1].poses[-1].position
    assert (goal.x, goal.y) == pytest.approx((4.0, 6.0), abs=0.3)
    heights = run.session.navigator.server.ground_heights(4.0, 6.0)
    assert goal.z == pytest.approx(heights[0], abs=0.1), "a click at height 0 means the ground"
    assert app.stamps["/tf"] == sorted(app.stamps["/tf"]) and app.times == sorted(app.times)


def test_one_who_comes_late_gets_the_world_the_map_the_plan_and_the_whole_track(served, client):
    run = served()
    first = client(run)
    first.subscribe("/events", "/actions")
    first.until(lambda: finished(first))

    late = client(run)
    late.subscribe("/scene", "/mesh_map", "/plan", "/actions", "/scan")
    entities = late.until(lambda: [one for message in late.messages.get("/scene", []) for one in message.entities])
    late.until(lambda: "/scan" in late.messages)
    entities = {one.id: one for message in late.messages["/scene"] for one in message.entities}

    assert {"ground", "start", "goal", "body", "wheel 0", "track 0"} <= set(entities)
    assert late.newest("/mesh_map").entities[0].id == "costs"
    assert late.newest("/plan").poses and late.newest("/actions")["move_base"] == "SUCCESS"
    late.send({"op": "unsubscribe", "subscriptionIds": [100 + late.channels["/scan"]["id"]]})
    late.subscribe("/scan")
    late.until(lambda: len(late.messages["/scan"]) > 1)


def test_a_point_is_a_goal_with_the_heading_in_which_the_robot_sees_it(served, client):
    run = served()
    app = client(run)
    app.subscribe("/events")
    app.until(lambda: finished(app))
    app.publish("/clicked_point", {**HERE, "point": {"x": 9.0, "y": 2.0, "z": 0.0}})
    app.until(lambda: len(finished(app)) == 2)

    assert finished(app)[-1]["data"]["outcome"] == 0
    assert run.session.simulation.robot.pose().yaw == pytest.approx(-1.57, abs=0.4)


def test_services_hold_the_robot_let_it_go_on_and_cancel_its_goals(served, client):
    run = served(start=False)
    app = client(run)
    app.subscribe("/events")
    assert app.call("/pause")["success"]
    run.start()
    app.until(lambda: any(one["kind"] == "goal_paused" for one in app.messages.get("/events", [])))
    assert app.call("/resume")["success"]
    app.until(lambda: any(one["kind"] == "goal_resumed" for one in app.messages["/events"]))
    assert app.call("/cancel") == {"success": True, "message": "The goals are canceled."}
    app.until(lambda: finished(app))

    assert finished(app)[-1]["data"]["message"] == "canceled in Foxglove"
    app.send(struct.pack("<BIII", 2, 99, 5, 4) + b"json{}")
    assert app.operation("serviceCallFailure")["callId"] == 5


def test_parameters_are_read_and_those_that_may_change_while_it_runs_are_changed(served, client):
    run = served()
    app = client(run)
    app.send({"op": "getParameters", "parameterNames": [], "id": "all"})
    found = {one["name"]: one.get("value") for one in app.operation("parameterValues")["parameters"]}
    app.send({"op": "setParameters", "parameters": [{"name": "planner_patience", "value": 7.5}], "id": "mine"})
    changed = app.operation("parameterValues")
    app.send({"op": "setParameters", "parameters": [{"name": "planner_patience", "value": -1.0}]})
    refused = app.operation("parameterValues")

    assert found["global_frame"] == "map" and found["planner_patience"] != 7.5
    assert changed["id"] == "mine" and changed["parameters"] == [{"name": "planner_patience", "value": 7.5}]
    assert refused["parameters"] == changed["parameters"]
    assert "planner_patience" in app.operation("status")["message"]
    app.send({"op": "setParameters", "parameters": [{"name": "dance", "value": 1}]})
    assert "there is no parameter 'dance'; known keys: planner_frequency, " in app.operation("status")["message"]


def test_a_page_of_another_site_and_one_who_does_not_know_the_token_are_refused(served, client):
    run = served(start=False, origins=("http://lichtblick.local",))
    for origin in ("https://evil.example", "null", "https://app.foxglove.dev.evil.example"):
        with pytest.raises(InvalidStatus, match="403"):
            client(run, origin=origin)
    for origin in (None, "https://app.foxglove.dev", "http://lichtblick.local"):
        assert client(run, origin=origin).operation("serverInfo")["name"] == "mbf outdoor"
    with pytest.raises(InvalidStatus, match="403"):
        client(run, additional_headers={"Host": "evil.example"})
    run.address = lambda role: f"ws://127.0.0.1:{run.live.port}/guess/"
    with pytest.raises(InvalidStatus, match="403"):
        client(run)
    run.address = lambda role: f"ws://127.0.0.1:{run.live.port}/"
    with pytest.raises(InvalidStatus, match="403"):
        client(run)
    with pytest.raises((InvalidStatus, NegotiationError)):
        client(run, subprotocols=["chat"])
    assert [note for note in run.notes if "evil.example may not connect; see --foxglove-origin" in note]


@pytest.mark.parametrize("subprotocol", SUBPROTOCOLS)
def test_apps_of_both_generations_are_understood(served, client, subprotocol):
    app = client(served(start=False), subprotocols=["else", subprotocol])
    assert app.operation("serverInfo")["supportedEncodings"] == ["json"]
    assert app.socket.subprotocol == subprotocol


def test_who_may_only_watch_sees_everything_and_changes_nothing(served, client):
    run = served(start=False)
    watcher = client(run, Role.WATCH)
    capabilities = watcher.operation("serverInfo")["capabilities"]
    watcher.subscribe("/events", "/tf")
    for frame in (
        {"op": "advertise", "channels": [{"id": 1, "topic": "/move_base_simple/goal", "encoding": "json"}]},
        {"op": "setParameters", "parameters": [{"name": "planner_patience", "value": 7.5}]},
        struct.pack("<BI", 1, 1) + json.dumps(GOAL).encode(),
    ):
        watcher.send(frame)
        assert watcher.operation("status")["message"] == "this client may only watch"
    watcher.send(struct.pack("<BIII", 2, 1, 5, 4) + b"json{}")
    assert watcher.operation("serviceCallFailure")["message"] == "this client may only watch"
    run.start()
    watcher.until(lambda: finished(watcher))

    assert "clientPublish" not in capabilities and "services" not in capabilities
    assert not [one for one in watcher.messages["/events"] if one["source"] == "foxglove"]
    assert watcher.messages["/tf"]


@pytest.mark.parametrize(
    ("frame", "text"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", 'expected an object with a text "op"'),
        ({"op": "dance"}, "'dance' is not offered"),
        ({"op": "subscribe"}, "subscriptions: expected a list, got nothing"),
        ({"op": "subscribe", "subscriptions": [7]}, "channelId: expected a whole number"),
        ({"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}, "id: expected a whole number"),
        ({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 999}]}, "there is no channel 999"),
        ({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}] * 2}, "is subscribed to already"),
        ({"op": "unsubscribe", "subscriptionIds": [3]}, "there is no subscription 3"),
        ({"op": "advertise", "channels": [{"id": 1, "topic": "/cmd_vel", "encoding": "json"}]}, "nobody listens"),
        ({"op": "advertise", "channels": [{"id": 1, "topic": "/clicked_point", "encoding": "cdr"}]}, "encoding json"),
        ({"op": "getParameters", "parameterNames": [1]}, "name: expected a text"),
        (b"", "cut short"),
        (b"\x01\x02", "cut short"),
        (b"\x09", "unknown opcode 9"),
        (struct.pack("<BI", 1, 3), "channel 3 has not been advertised"),
        (struct.pack("<BIII", 2, 1, 1, 4) + b"\xff\xfe\xfd\xfc", "damaged"),
    ],
)
def test_rubbish_is_answered_and_the_connection_stays(idle_app, frame, text):
    idle_app.send(frame)
    assert text in idle_app.operation("status")["message"]
    idle_app.send({"op": "getParameters", "parameterNames": ["global_frame"]})
    assert idle_app.operation("parameterValues")["parameters"] == [{"name": "global_frame", "value": "map"}]


def test_one_wrong_entry_of_a_list_drops_no_other(served, client):
    app = client(served())
    channels = [{"id": 1, "topic": topic, "encoding": "json"} for topic in ("/goal_pose", "/clicked_point")]
    channels[1]["id"] = 2
    app.send({"op": "advertise", "channels": channels})
    answer = app.operation("status")
    assert "nobody listens" in answer["message"] and answer["level"] == 0
    events = app.channel("/events")["id"]
    subscriptions = [{"id": 1, "channelId": 999}, {"id": 100 + events, "channelId": events}]
    app.send({"op": "subscribe", "subscriptions": subscriptions})
    assert "there is no channel 999" in app.operation("status")["message"]
    app.until(lambda: finished(app))
    app.send(struct.pack("<BI", 1, 2) + json.dumps({**HERE, "point": {"x": 9.0, "y": 2.0, "z": 0.0}}).encode())
    app.until(lambda: len(finished(app)) == 2)
    app.send({"op": "unsubscribe", "subscriptionIds": [999, 100 + events]})
    assert "there is no subscription 999" in app.operation("status")["message"]
    app.subscribe("/events")


def test_a_change_that_a_plugin_does_not_survive_is_answered(served, client, monkeypatch):
    run = served()
    app = client(run)

    def fail(**changes):
        raise RuntimeError("the plugin is broken")

    monkeypatch.setattr(run.session.navigator.server, "set_parameters", fail)
    app.send({"op": "setParameters", "parameters": [{"name": "planner_patience", "value": 7.5}], "id": "mine"})
    assert app.operation("parameterValues")["id"] == "mine"
    assert app.operation("status")["message"] == "RuntimeError: the plugin is broken"


def test_where_somebody_says_that_the_robot_is_the_localisation_believes(served, client):
    run = served()
    app = client(run)
    app.subscribe("/events")
    app.until(lambda: finished(app))
    said = {"position": {"x": 4.0, "y": 2.5, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 1.0, "w": 1.0}}
    app.publish("/initialpose", {**HERE, "pose": {"pose": said, "covariance": [0.0] * 36}})
    app.until(lambda: [one for one in app.messages["/events"] if one["source"] == "localization"])
    stamp, robot = run.session.clock.now(), run.session.navigator.robot_pose
    app.until(lambda: robot().stamp > stamp)
    assert (robot().x, robot().y, robot().yaw) == pytest.approx((4.0, 2.5, math.pi / 2.0), abs=0.05)
    app.publish("/initialpose", {**HERE, "pose": said})
    assert "pose.position: expected the numbers" in app.operation("status")["message"]


@pytest.mark.parametrize(
    ("message", "text"),
    [
        ([], "expected a pose in the frame 'map', got None"),
        ({**GOAL, "header": {"frame_id": "odom"}}, "got 'odom': choose it as display frame"),
        ({**GOAL, "pose": {}}, "pose.position: expected the numbers x, y, z"),
        ({**GOAL, "pose": GOAL["pose"] | {"orientation": dict.fromkeys("xyzw", 0)}}, "no quaternion"),
        (
            {**GOAL, "pose": GOAL["pose"] | {"position": {"x": float("nan"), "y": 0, "z": 0}}},
            "not JSON: JSON has no number NaN",
        ),
        ({**GOAL, "pose": GOAL["pose"] | {"position": {"x": 10**400, "y": 0, "z": 0}}}, "a number is not finite"),
        ({**GOAL, "pose": GOAL["pose"] | {"position": {"x": 1e200, "y": 0, "z": 0}}}, "a number is beyond 1e+09"),
        ({**GOAL, "pose": GOAL["pose"] | {"position": {"x": True, "y": 0, "z": 0}}}, "expected the numbers"),
    ],
)
def test_a_goal_that_means_nothing_is_answered(idle_app, message, text):
    idle_app.publish("/move_base_simple/goal", message)
    assert text in idle_app.operation("status")["message"]


def test_a_client_that_reads_nothing_delays_nobody(served, client):
    run = served(start=False)
    dead = client(run, max_queue=1)
    dead.send(
        {"op": "subscribe", "subscriptions": [{"id": 100 + number, "channelId": number} for number in range(1, 11)]}
    )
    awake = client(run)
    awake.subscribe("/events")
    run.start()
    awake.until(lambda: finished(awake))

    assert finished(awake)[0]["data"]["outcome"] == 0


def test_a_run_is_the_same_drive_whoever_watches(meadow, tmp_path, client):
    class Watched(LiveFoxglove):
        def __enter__(self):
            super().__enter__()
            self.address = lambda role: self.access.address(self.port, role).replace("http", "ws", 1)
            app = client(self)
            app.subscribe(*TOPICS)
            app.send({"op": "getParameters", "parameterNames": [], "id": "x"})
            app.operation("parameterValues")  # all subscriptions are in force before the run begins
            return self

    options = FoxgloveOptions(port=18765)
    drives = {}
    for name, watch in {"alone": None, "watched": partial(Watched, options=options, speed=0.0)}.items():
        chosen = {} if watch is None else {"watch": watch}
        result = run_scenario(meadow, RunOptions(tmp_path / name, **chosen))
        drives[name] = result.metrics["digest"], (tmp_path / name / "events.jsonl").read_bytes()

    assert drives["alone"] == drives["watched"]


def test_the_next_port_is_taken_and_where_nothing_can_listen_it_is_said(served, meadow):
    ports = [served(start=False).live.port for _ in range(2)]
    assert ports[0] != ports[1] and all(18765 <= port < 18765 + 20 for port in ports), ports
    with pytest.raises(ServerError, match=r"cannot listen at 203\.0\.113\.1:18765"):
        served(start=False, host="203.0.113.1")


def test_read_only_there_is_no_address_to_steer_from_and_no_token_is_for_loopback_only(served, client):
    run = served(start=False, read_only=True)
    assert run.live.access.address(run.live.port, Role.STEER) is None
    assert client(run, Role.WATCH).operation("serverInfo")["capabilities"] == ["time", "parameters"]
    with pytest.raises(ValueError, match="at loopback only"):
        FoxgloveOptions(host="0.0.0.0", token=False)
