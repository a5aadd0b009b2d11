"""Whatever a client sends, it gets an answer that is JSON, and the server has no fault; without sockets."""

import asyncio
import json
from collections import OrderedDict, deque
from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbf_abstract.access.outbox import Outbox
from mbf_abstract.access.page_access import Role
from mbf_abstract.events import EventKind
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.messages.interfaces import fields_of
from mbf_ros.rosbridge.actionlib import ActionlibServer
from mbf_ros.rosbridge.authentication import Authentication
from mbf_ros.rosbridge.bridge import Bridge
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.navigation import ACTIONS, NODE, ServerParameters, serve_navigator
from mbf_ros.rosbridge.rosapi import serve_rosapi

OPERATIONS = (
    *("advertise", "unadvertise", "publish", "subscribe", "unsubscribe", "call_service", "send_action_goal"),
    *("cancel_action_goal", "advertise_action", "unadvertise_action", "action_feedback", "action_result"),
    *("set_level", "auth", "fragment", "dance"),
)
TOPICS = ("/goal_pose", "/move_base/goal", "/move_base/cancel", "/cmd_vel", "/chatter", "odom", "")
TYPES = ("geometry_msgs/PoseStamped", "std_msgs/String", "move_base_msgs/MoveBaseActionGoal", "x/Y", "")

numbers = st.floats(-9, 9) | st.integers(-1, 3) | st.sampled_from([None, float("nan"), 2**70, "1"])
leaves = numbers | st.booleans() | st.text(max_size=5)
anything = st.recursive(leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner))


def values_of(field):
    if "/" in field.type:
        one = message_of(field.type)
    elif field.type.startswith(("float", "int", "uint")):
        one = st.integers(0, 2) if "int" in field.type else numbers
    else:
        one = st.sampled_from(["", "", "map", "/odom"]) if field.type == "string" else st.booleans()
    return one if field.length is None else st.lists(one, max_size=2)


@cache
def message_of(type_name):
    """A message of a type: what is required, some of the rest, and most numbers such as are meant."""
    fields = {field.name: values_of(field) for field in fields_of(type_name)}
    required = {field.name: fields.pop(field.name) for field in fields_of(type_name) if field.required}
    return st.fixed_dictionaries(required, optional=fields)


def operation(op, **fields):
    return st.fixed_dictionaries({"op": st.just(op), "id": st.sampled_from("ab"), **fields})


def goal_of(name):
    goal = message_of(f"{ACTIONS[name].type}_Goal")
    return operation("send_action_goal", action=st.just(name), args=goal, feedback=st.booleans())


services = [f"{NODE}/{name}" for name in ("check_pose_cost", "pause", "clear_costmaps")]
services += [f"/rosapi/{name}" for name in ("topics", "topic_type", "get_param", "set_param", "message_details")]
texts = st.sampled_from([*TYPES, f"{NODE}/tf_timeout", "[1]", "0.5"])
requests = st.fixed_dictionaries({}, optional={name: texts for name in ("name", "value", "type", "topic")})
meant = st.one_of(
    *map(goal_of, ACTIONS),
    operation("publish", topic=st.just("/goal_pose"), msg=message_of("geometry_msgs/PoseStamped")),
    operation("publish", topic=st.just("/move_base/goal"), msg=message_of("move_base_msgs/MoveBaseActionGoal")),
    operation("publish", topic=st.just("/move_base/cancel"), msg=message_of("actionlib_msgs/GoalID")),
    operation("publish", topic=st.just("/chatter"), msg=anything),
    operation("advertise", topic=st.sampled_from(TOPICS), type=st.sampled_from(TYPES), latch=st.booleans()),
    operation("subscribe", topic=st.sampled_from(TOPICS), type=st.sampled_from(TYPES), throttle_rate=numbers),
    operation("unsubscribe", topic=st.sampled_from(TOPICS)),
    operation("cancel_action_goal"),
    operation("call_service", service=st.sampled_from(services), args=requests | anything),
)
wild = st.fixed_dictionaries(
    {"op": st.sampled_from(OPERATIONS)},
    optional={
        name: anything
        for name in (
            "id",
            "topic",
            "type",
            "msg",
            "service",
            "args",
            "action",
            "throttle_rate",
            "latch",
            "mac",
            "feedback",
        )
    },
)


@pytest.fixture(scope="module")
def session():
    with ScriptedSession() as made:
        yield made


def bridge_of(session):
    context = MessageContext()
    bridge = Bridge(session.clock, session.events, context, Authentication({}, lambda: 0.0))
    serve_navigator(bridge, session.navigator, context)
    serve_rosapi(bridge, ServerParameters(session.navigator), NODE, context, session.clock.now)
    ActionlibServer(bridge.topics, session.navigator, context, session.clock.now, lambda call, *arguments: None)
    return bridge


@settings(max_examples=300)
@given(sent=st.lists(meant | meant | wild | anything, min_size=1, max_size=8))
def test_every_operation_is_done_or_refused_with_a_text(session, sent):
    async def run():
        bridge, ended = bridge_of(session), []
        client = Client("test", Role.STEER, ended.append)
        for operation in sent:
            bridge.take(client, json.dumps(operation))
        frames = []
        while not client.outbox.is_empty:
            frames.append(json.loads(await client.outbox.take(), parse_constant=pytest.fail))
        bridge.forget(client)
        return frames

    answers = asyncio.run(run())
    session.server.cancel_all()
    known = {"status", "service_response", "action_result", "action_feedback", "publish"}
    assert {answer["op"] for answer in answers} <= known
    assert [event.data for event in session.memory.of_kind(EventKind.FAULT) if event.source == "rosbridge"] == []


@given(
    st.lists(
        st.tuples(st.sampled_from(["answer", "newest", "take"]), st.sampled_from("ab"), st.integers(1, 3)), max_size=40
    )
)
def test_an_outbox_keeps_answers_and_the_newest_of_each_kind_as_its_naive_twin(steps):
    async def run():
        outbox, naive, taken = Outbox(), OrderedDict(), []
        for number, (step, kind, keep) in enumerate(steps):
            text = str(number)
            if step == "answer":
                outbox.answer(text)
                naive[text] = deque([text])
            elif step == "newest":
                outbox.newest(kind, text, keep)
                naive[kind] = deque([*naive.get(kind, ()), text], maxlen=keep)
            elif naive:
                first, frames = next(iter(naive.items()))
                taken.append((await outbox.take(), frames.popleft()))
                naive.move_to_end(first)
                if not frames:
                    del naive[first]
        assert outbox.is_empty == (not naive)
        return taken

    assert all(ours == theirs for ours, theirs in asyncio.run(run()))
