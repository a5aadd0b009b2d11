"""What a visitor's own script may send beside viser's controls, who may send it, and what becomes of all else."""

import asyncio
import json
import math

import numpy as np
import pytest
import viser
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from mbf_abstract.access.page_access import PageAccess, Role
from mbf_abstract.time.clock import WallClock
from terrain.viewer.server.page_server import page_server
from terrain.viewer.server.visitor_channel import MAX_REFUSED, PREFIX, VisitorChannel
from terrain.viewer.server.visitor_messages import parsed

PORT = 18750
RIGHT = [
    ({"point": [0.25, 1]}, ("point", 7, (0.25, 1.0))),
    ({"point": None}, ("point", 7, None)),
    ({"goal": [[0, 0], [0.5, 1.0]]}, ("place_goal", 7, (0.0, 0.0), (0.5, 1.0))),
    ({"stick": [-1, 0.5, 12.25]}, ("hold_stick", 7, -1.0, 0.5, 12.25)),
    ({"stick": None}, ("release_stick", 7)),
    ({"look": "follow"}, ("look", 7, "follow")),
]
FOR_WATCHERS = ("point", "look")


class Noted:
    """Actions that note what they were called with."""

    def __init__(self):
        self.calls = []

    def __getattr__(self, name):
        return lambda *arguments: self.calls.append((name, *arguments))


def done_by(message, role=Role.STEER):
    text = message if isinstance(message, str | bytes) else json.dumps(message)
    action, noted = parsed(text, role), Noted()
    if action is not None:
        action(noted, 7)
    return noted.calls


@pytest.mark.parametrize(("message", "call"), RIGHT, ids=str)
def test_what_the_script_sends_arrives_and_from_watchers_only_what_steers_nothing(message, call):
    assert done_by(message) == [call]
    assert done_by(message, Role.WATCH) == ([call] if set(message) <= set(FOR_WATCHERS) else [])


@pytest.mark.parametrize(
    "message",
    [
        b'{"point": null}', "", "null", "[]", "{}", "nonsense", "[" * 150, '{"point": [NaN, 0]}',
        '{"point": [1e999, 0]}',
        {"point": [0.5]}, {"point": [0.5, 1.01]}, {"point": [True, 0.5]}, {"point": ["0", 0]}, {"point": "null"},
        {"goal": None}, {"goal": [[0, 0]]}, {"goal": [[0, 0], None]}, {"goal": [0, 0]}, {"goal": [[0, 0], [0, 2]]},
        {"stick": [2, 0, 1]}, {"stick": [0, -1.1, 1]}, {"stick": [0, 0]}, {"stick": [0, 0, 0, 0]}, {"stick": "up"},
        {"stick": [[], {}, 1]}, {"stick": [0, 0, None]}, {"stick": [0, 0, True]}, '{"stick": [0, 0, NaN]}',
        '{"stick": [0, 0, 1e999]}', {"stick": [0, 0, 2**70]},
        {"look": "away"}, {"look": None}, {"look": ["follow"]}, {"drive": [0, 0]}, {"": None},
        {"point": None, "look": "follow"}, {"look": "follow" + " " * 200},
    ],
    ids=repr,
)  # fmt: skip
def test_a_wrong_message_does_nothing(message):
    assert done_by(message) == []


def test_whatever_comes_nothing_is_raised_and_only_right_values_arrive():
    rng = np.random.default_rng(3)
    values = [None, True, -1, 0, 0.5, 1, 2**70, math.nan, math.inf, "", "follow", "x" * 300, [], {}, [0.5, 0.5]]

    def any_value(depth=0):
        number = rng.integers(len(values) + (2 if depth < 3 else 0))
        return values[number] if number < len(values) else [any_value(depth + 1) for _ in range(rng.integers(4))]

    calls = []
    for _ in range(2000):
        names = rng.choice(["point", "goal", "stick", "look", "role", "leave"], size=rng.integers(1, 3), replace=False)
        message = json.dumps({str(name): any_value() for name in names})
        calls += done_by(message) + done_by(message.encode()) + done_by(message[: rng.integers(len(message))])
    assert {name for name, *_ in calls} == {"point", "look", "release_stick"}
    for call in calls:
        numbers = np.array([one for one in call[2:] if isinstance(one, tuple)] or 0.0, dtype=float)
        assert (np.abs(numbers) <= 1.0).all() and all(one != "leave" for one in call)


class Served:
    """A page with a channel, and a visitor of viser's whose key is known."""

    def __init__(self, server, access, channel, clock):
        self.access, self.channel, self.clock, self.port = access, channel, clock, server.get_port()
        self.actions = channel.actions = Noted()
        self._client = type("Client", (), {"client_id": 7, "_websock_connection": self})()
        channel._welcome(self._client)
        (self.key,) = channel._visitors

    def queue_message(self, message):
        self.script = message.source

    def socket(self, key, role=Role.STEER, origin=None):
        host = f"127.0.0.1:{self.port}"
        token = next(token for token, allowed in self.access.roles.items() if allowed is role)
        return connect(f"ws://{host}/{token}{PREFIX}{key}", origin=origin or f"http://{host}")

    async def until(self, condition):
        async def poll():
            while not condition():
                await asyncio.sleep(0.01)

        await asyncio.wait_for(poll(), 20.0)


@pytest.fixture(scope="module")
def served():
    access, clock = PageAccess.by_token(), WallClock()
    channel = VisitorChannel("(path) => {}", clock)
    with page_server(PORT, access, channel=channel) as server:
        yield Served(server, access, channel, clock)


def test_a_visitor_learns_the_role_acts_gets_answers_and_is_forgotten(served):
    async def visit():
        async with served.socket(served.key) as socket:
            role = json.loads(await socket.recv())
            beats = [json.loads(await socket.recv())["beat"] for _ in range(3)]
            assert beats == sorted(set(beats)) and 0.0 <= served.clock.now() - beats[-1] < 20.0
            await socket.send(json.dumps({"stick": [0.5, 1, beats[-1]]}))
            await served.until(lambda: ("hold_stick", 7, 0.5, 1.0, beats[-1]) in served.actions.calls)
            served.channel.send(7, "stick", "driving")
            served.channel.send(8, "stick", "to nobody")
            async with served.socket(served.key) as second:
                with pytest.raises(ConnectionClosed):
                    await second.recv()
            while "stick" not in (answer := json.loads(await socket.recv())):
                pass
            return role, answer

    role, answer = asyncio.run(visit())
    assert role == {"role": "steer"} and answer == {"stick": "driving"}
    asyncio.run(served.until(lambda: served.actions.calls[-1] == ("leave", 7)))
    assert served.key in served.script and served.script.startswith("((path) => {})(")


def test_a_watcher_cannot_hold_the_stick(served):
    async def visit():
        async with served.socket(served.key, Role.WATCH) as socket:
            role = json.loads(await socket.recv())
            for message in ('{"stick": [0, 1, 1]}', '{"goal": [[0, 0], [0, 0]]}', '{"look": "overview"}'):
                await socket.send(message)
            await served.until(lambda: ("look", 7, "overview") in served.actions.calls)
            return role

    served.actions.calls.clear()
    assert asyncio.run(visit()) == {"role": "watch"}
    assert not [call for call in served.actions.calls if call[0] in ("hold_stick", "place_goal")]


def test_without_the_key_of_a_visitor_or_from_another_page_nobody_gets_in(served):
    async def visit(key, **how):
        async with served.socket(key, **how) as socket:
            await socket.recv()

    for key in ("", "guessed", served.key[:-1]):
        with pytest.raises(ConnectionClosed) as closed:
            asyncio.run(visit(key))
        assert closed.value.rcvd.code == 1008
    with pytest.raises(InvalidStatus):
        asyncio.run(visit(served.key, origin="http://evil.example"))


def test_who_sends_nothing_but_nonsense_is_disconnected(served):
    async def visit():
        async with served.socket(served.key) as socket:
            for _ in range(MAX_REFUSED + 1):
                await socket.send("nonsense")
            while True:
                await socket.recv()

    with pytest.raises(ConnectionClosed) as closed:
        asyncio.run(asyncio.wait_for(visit(), 20.0))
    assert closed.value.rcvd.code == 1008


def test_viser_still_runs_scripts_and_reports_who_comes_and_goes():
    """The channel uses a message of viser's that is none of its public interface."""
    from viser._messages import RunJavascriptMessage

    assert RunJavascriptMessage("1").source == "1"
    assert callable(viser.ViserServer.on_client_connect) and callable(viser.ViserServer.on_client_disconnect)
