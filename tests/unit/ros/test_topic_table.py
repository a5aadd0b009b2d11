"""Topics of the rosbridge server: who may publish them, and the order in which a slow client gets grids and updates."""

import asyncio
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mbf_abstract.access.page_access import Role
from mbf_abstract.geometry import Pose
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.sim_clock import SimClock
from mbf_ros.messages.geometry import MessageContext
from mbf_ros.rosbridge.actionlib import ActionlibServer
from mbf_ros.rosbridge.client import Client
from mbf_ros.rosbridge.protocol import OperationError, frame
from mbf_ros.rosbridge.publishing import Publisher
from mbf_ros.rosbridge.topics import TopicTable

CONFIG = """
backend: costmap
global_costmap: {width: 2.0, height: 2.0, layers: [{name: area, type: keepout}], area: {zones: []}}
local_costmap: {width: 2.0, height: 2.0, layers: [{name: area, type: keepout}], area: {zones: []}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
"""
GRID, UPDATES, DIAGNOSTICS = "/global_costmap/costmap", "/global_costmap/costmap_updates", "/diagnostics"


@pytest.fixture(scope="module")
def topics(tmp_path_factory):
    """The topics of a navigator, of which nothing is sent by itself."""
    file, table, context = tmp_path_factory.mktemp("topics") / "robot.yaml", TopicTable(), MessageContext()
    file.write_text(CONFIG)
    with LoopbackSession(Pose.planar(1.0, 1.0), SimClock()) as session:
        session.serve(*read_config(file), session.robot, session.transforms)

        def post(call, *arguments):
            pass

        actionlib = ActionlibServer(table, session.navigator, context, session.clock.now, post)
        publisher = Publisher(session, table, context, post, actionlib, simulated=False)
        yield table
        publisher.close()


def client():
    return Client("test", Role.STEER, lambda reason: None)


async def waiting(client):
    """Message bodies that wait for a client, in the order in which they are sent."""
    found = []
    while not client.outbox.is_empty:
        found.append(json.loads(await client.outbox.take())["msg"])
    return found


def test_drivers_publish_diagnostics_beside_the_navigator(topics):
    async def run():
        driver, reader = client(), client()
        topics.advertise(driver, DIAGNOSTICS, "diagnostic_msgs/DiagnosticArray", latched=False)
        topics.subscribe(reader, DIAGNOSTICS, "", None, 0, 0)
        topics.publish(DIAGNOSTICS, {"status": [{"name": "battery"}]})
        topics.send(DIAGNOSTICS, frame("publish", topic=DIAGNOSTICS, msg={"status": [{"name": "velocity gate"}]}))
        topics.forget(driver)
        found = await waiting(reader)
        topics.forget(reader)
        return [message["status"][0]["name"] for message in found]

    assert asyncio.run(run()) == ["battery", "velocity gate"] and topics[DIAGNOSTICS].is_ours


@pytest.mark.parametrize("topic", ["/cmd_vel", "/plan", GRID])
def test_what_is_the_navigators_alone_is_published_by_nobody_else(topics, topic):
    with pytest.raises(OperationError, match="by the navigator only"):
        topics.advertise(client(), topic, topics[topic].type, latched=False)
    with pytest.raises(OperationError, match="by the navigator only"):
        topics.publish(topic, {})


@given(
    st.lists(st.sampled_from([GRID, UPDATES, UPDATES, "take"]), max_size=40),
    st.sampled_from([0, 1, 3]),
    st.sampled_from([0, 1, 3]),
)
def test_a_slow_client_never_gets_an_update_that_is_older_than_the_grid(topics, steps, grids, updates):
    """Messages are numbered as they are sent; ``grids`` and ``updates`` are the queues that the client asks for."""

    async def run():
        slow, taken = client(), []
        topics.subscribe(slow, GRID, "", None, 0, grids)
        topics.subscribe(slow, UPDATES, "", None, 0, updates)
        for number, step in enumerate(steps):
            if step != "take":
                topics.send(step, frame("publish", topic=step, msg=number))
            elif not slow.outbox.is_empty:
                taken.append(json.loads(await slow.outbox.take())["msg"])
        taken += await waiting(slow)
        topics.forget(slow)
        return taken

    taken = asyncio.run(run())
    newest = max((number for number, step in enumerate(steps) if step == GRID), default=None)
    assert taken == sorted(taken) and (newest is None or newest in taken)


def test_a_grid_that_waits_does_not_lose_its_turn_to_a_newer_one(topics):
    async def run():
        slow = client()
        topics.subscribe(slow, GRID, "", None, 0, 3)
        for number in range(3):
            topics.send(GRID, frame("publish", topic=GRID, msg=number))
            slow.outbox.newest("another topic", frame("publish", msg=-1))
        found = await waiting(slow)
        topics.forget(slow)
        return found

    assert asyncio.run(run()) == [2, -1]


def test_a_grid_drops_the_updates_that_a_throttled_client_has_yet_to_get(topics):
    async def run():
        slow = client()
        topics.subscribe(slow, GRID, "", None, 0, 0)
        topics.subscribe(slow, UPDATES, "", None, 50, 5)
        for number, topic in enumerate([UPDATES, UPDATES, UPDATES, GRID]):
            topics.send(topic, frame("publish", topic=topic, msg=number))
        found = await waiting(slow)
        topics.send(UPDATES, frame("publish", topic=UPDATES, msg=4))
        found.append(json.loads(await slow.outbox.take())["msg"])
        topics.forget(slow)
        return found

    assert asyncio.run(run()) == [3, 4]
