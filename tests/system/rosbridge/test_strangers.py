"""Who is not let in, and what a client that sends rubbish, too much, or nothing at all does to the others: nothing."""

import hashlib
import http.client
import json
from contextlib import suppress

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from mbf_abstract.access.page_access import PageAccess, Role
from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.time.clock import unix_seconds
from tests.system.rosbridge.conftest import creep

TOPICS = {"op": "call_service", "id": "t", "service": "/rosapi/topics"}
SECRETS = {"access": PageAccess("127.0.0.1", {"steering": Role.STEER, "watching": Role.WATCH})}


def get(port, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request("GET", path, headers=headers)
    response = connection.getresponse()
    return response.status, response.read()


def test_a_page_of_another_site_may_not_connect_unless_it_is_allowed(serving, raw, ask):
    _, server = serving(server={"origins": ("https://dash.local",)})
    with pytest.raises(InvalidStatus, match="403"):
        raw(server.port, origin="https://evil.example")
    with pytest.raises(InvalidStatus, match="403"):
        raw(server.port, origin="null")
    for origin in ("https://dash.local", f"http://127.0.0.1:{server.port}", None):
        assert ask(raw(server.port, origin=origin), TOPICS, "service_response")["result"] is True


def test_a_foreign_name_of_this_machine_is_refused(serving):
    _, server = serving()
    assert get(server.port, "/", Host=f"evil.example:{server.port}")[0] == 403
    assert get(server.port, "/")[0] == 200


def test_the_address_needs_its_token(serving, raw, ask):
    _, server = serving(server=SECRETS)
    with pytest.raises(InvalidStatus, match="403"):
        raw(server.port, path="/guess/")
    assert get(server.port, "/")[0] == 403
    assert get(server.port, "/steering/")[0] == 200
    assert ask(raw(server.port, path="/steering/"), TOPICS, "service_response")["result"] is True


def authentication(token, now, **changed):
    fields = {"client": "me", "dest": "robot", "rand": "7", "t": int(now), "level": "admin", "end": int(now) + 60}
    fields |= changed
    text = "".join(str(fields[name]) for name in ("client", "dest", "rand", "t", "level", "end"))
    return {"op": "auth", "mac": hashlib.sha512((token + text).encode()).hexdigest(), **fields}


def test_a_client_may_prove_with_auth_that_it_knows_the_token_once(serving, raw, ask):
    _, server = serving(server=SECRETS)
    proof = authentication("steering", unix_seconds())
    socket = raw(server.port)
    socket.send(json.dumps(proof))
    assert ask(socket, TOPICS, "service_response")["result"] is True
    with pytest.raises(ConnectionClosed):
        ask(raw(server.port), proof, "service_response")


@pytest.mark.parametrize("changed", ["a guess", "old", "ended", "another", "none"])
def test_without_a_good_proof_nothing_is_done_and_the_connection_ends(serving, raw, ask, changed):
    _, server = serving(server=SECRETS)
    now = unix_seconds()
    proof = {
        "a guess": authentication("guess", now),
        "old": authentication("steering", now - 60),
        "ended": authentication("steering", now, end=int(now) - 1),
        "another": {**authentication("steering", now), "rand": "8"},
        "none": {"op": "call_service", "service": "/move_base_flex/pause"},
    }[changed]
    with pytest.raises(ConnectionClosed):
        ask(raw(server.port), proof, "service_response")


def test_who_may_only_watch_sees_everything_and_changes_nothing(serving, raw, ask):
    session, server = serving(server=SECRETS)
    socket = raw(server.port, path="/watching/")
    assert ask(socket, {"op": "subscribe", "topic": "/odom"}, "publish")["topic"] == "/odom"
    assert ask(socket, TOPICS, "service_response")["result"] is True
    pose = {"pose": {"position": {"x": 1.0, "y": 0.0}}}
    for operation in (
        {"op": "publish", "topic": "/goal_pose", "msg": pose},
        {"op": "advertise", "topic": "/chatter", "type": "std_msgs/String"},
        {"op": "send_action_goal", "id": "g", "action": "/navigate_to_pose", "args": {"pose": pose}},
        {"op": "call_service", "service": "/move_base_flex/cancel_all"},
        {"op": "call_service", "service": "/rosapi/set_param"},
    ):
        assert "may only watch" in ask(socket, operation, "status")["msg"]
    assert session.server.move_base.unfinished == []


@pytest.mark.parametrize(
    ("rubbish", "text"),
    [
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("9" * 5000, "not JSON"),
        (b"\x00\x01", "in a text frame, got a binary frame"),
        ("[]", 'expected an object with a text "op"'),
        ('{"op": 3}', 'expected an object with a text "op"'),
        ('{"op": "dance"}', "'dance' is not offered: it is not known"),
        ('{"op": "fragment"}', "send whole messages"),
        ('{"op": "advertise_service"}', "clients cannot offer services"),
        ('{"op": "subscribe"}', "topic: expected a text"),
        ('{"op": "subscribe", "topic": "/dance"}', "its type must be given"),
        ('{"op": "subscribe", "topic": "/odom", "type": "std_msgs/String"}', "expected the type nav_msgs/msg/Odometry"),
        ('{"op": "subscribe", "topic": "/odom", "throttle_rate": -1}', "throttle_rate: expected a number"),
        ('{"op": "subscribe", "topic": "/odom", "throttle_rate": NaN}', "throttle_rate: expected a number"),
        ('{"op": "subscribe", "topic": "/odom", "compression": "cbor-raw"}', "cbor-raw is not offered"),
        ('{"op": "publish", "topic": "/dance", "msg": {}}', "was not advertised"),
        ('{"op": "publish", "topic": "/cmd_vel", "msg": {}}', "published by the navigator only"),
        ('{"op": "advertise", "topic": "/tf", "type": "tf2_msgs/TFMessage"}', "published by the navigator only"),
        ('{"op": "publish", "topic": "/goal_pose", "msg": {"pose": 3}}', "expected an object"),
        ('{"op": "publish", "topic": "/goal_pose", "msg": {"pose": {"position": {"x": null, "y": 1}}}}', "finite"),
        ('{"op": "cancel_action_goal", "id": "none"}', "no unfinished goal 'none'"),
        ('{"op": "call_service", "service": 3, "id": "s"}', "service: expected a text"),
        ('{"op": "set_level", "id": 7}', "id: expected a text"),
    ],
    ids=lambda value: value[:40] if isinstance(value, str) else "bytes",
)
def test_rubbish_is_answered_with_what_is_wrong_and_the_next_operation_works(serving, raw, ask, rubbish, text):
    _, server = serving()
    socket = raw(server.port)
    assert text in ask(socket, rubbish, "status")["msg"]
    assert ask(socket, TOPICS, "service_response")["result"] is True


def test_a_message_that_is_too_long_ends_its_connection_only(serving, raw, ask):
    _, server = serving(server={"max_message": 10_000})
    other = raw(server.port)
    with pytest.raises(ConnectionClosed, match="1009"):
        ask(raw(server.port), {"op": "publish", "topic": "/x", "msg": {"data": "x" * 20_000}}, "status")
    assert ask(other, TOPICS, "service_response")["result"] is True


def test_more_clients_than_allowed_are_sent_away(serving, raw, ask):
    _, server = serving(server={"max_clients": 1})
    first = raw(server.port)
    assert ask(first, TOPICS, "service_response")["result"] is True
    with pytest.raises(ConnectionClosed, match="1013"):
        ask(raw(server.port), TOPICS, "service_response")


def test_who_has_no_token_takes_no_place_of_those_who_have_one(serving, raw, ask):
    access = PageAccess.by_token()
    _, server = serving(server={"access": access, "max_clients": 1})
    stranger = raw(server.port)
    with pytest.raises(ConnectionClosed, match="1013"):
        ask(raw(server.port), TOPICS, "service_response")
    token = next(iter(access.roles))
    assert ask(raw(server.port, path=f"/{token}/"), TOPICS, "service_response")["result"] is True
    stranger.close()


def drive(socket, ask):
    goal = {"pose": {"position": {"x": 5.0, "y": 0.0}}}
    message = {"op": "send_action_goal", "id": "g", "action": "/navigate_to_pose", "args": {"pose": goal}}
    ask(socket, {**message, "feedback": True}, "action_feedback")


@pytest.mark.parametrize("cancels", [True, False])
def test_a_client_that_is_gone_stops_the_robot_unless_goals_are_kept(serving, raw, ask, cancels):
    session, server = serving(cancel_on_disconnect=cancels)
    session.controller.play(creep)
    socket = raw(server.port)
    drive(socket, ask)
    (handle,) = session.server.move_base.unfinished
    socket.socket.shutdown(2)  # as when its process is killed: no closing handshake
    if cancels:
        assert handle.wait(20).outcome_name == "CANCELED"
        assert "the client has disconnected" in handle.cancel_reason
    else:
        watching = raw(server.port)
        ask(watching, {"op": "subscribe", "topic": "/odom"}, "publish")
        assert not handle.done
        ask(watching, {"op": "call_service", "service": "/navigate_to_pose/_action/cancel_goal"}, "service_response")
        assert handle.wait(20).outcome_name == "CANCELED"


class Gone:
    """Notes the clients that are gone."""

    def __init__(self, note):
        self.note = note

    def write(self, event):
        if event.source == "rosbridge" and event.data["message"] == "client gone":
            self.note(event.data["client"])

    def close(self):
        pass


def test_a_client_that_does_not_read_delays_neither_the_robot_nor_others_and_is_sent_away(serving, raw, ask, answers):
    session, server = serving()
    gone = answers()
    session.events.add_sink(Gone(gone))
    silent, other = raw(server.port), raw(server.port)
    for topic in ("/odom", "/tf", "/move_base_flex/events"):
        silent.send(json.dumps({"op": "subscribe", "topic": topic}))
    details = {
        "op": "call_service",
        "service": "/rosapi/message_details",
        "args": {"type": "mbf_msgs/action/ExePath_Goal"},
    }
    with suppress(ConnectionClosed):
        for _ in range(10_000):  # some 30 MB of answers that nobody reads
            silent.send(json.dumps(details))
    result = session.server.move_base.send(MoveBaseGoal(Pose.planar(0.5, 0.0))).wait(20)
    assert result.success
    assert ask(other, TOPICS, "service_response")["result"] is True
    assert gone.wait() == ["{}:{}".format(*silent.local_address)]
