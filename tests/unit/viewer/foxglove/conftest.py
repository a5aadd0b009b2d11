"""A run that is served to Foxglove, and a client that speaks the protocol as its specification has it."""

import base64
import json
import struct
import threading
import time
from contextlib import ExitStack

import pytest
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from websockets.sync.client import connect

from mbf_abstract.access.foxglove import FoxgloveOptions
from mbf_abstract.access.page_access import Role
from terrain.session.executives import make_executive
from terrain.session.goal_sequence import GoalSequence
from terrain.session.session import Session
from terrain.viewer.foxglove.live import LiveFoxglove

WITHIN = 60.0  # s; nothing waits that long unless it fails


class Client:
    """Keeps what the server says; ``messages`` by topic, decoded with the advertised schemas alone."""

    def __init__(self, address, **fields):
        fields = {"subprotocols": ["foxglove.sdk.v1"], "max_size": None} | fields
        self.socket = connect(address, open_timeout=WITHIN, close_timeout=1.0, **fields)
        self.operations, self.messages, self.answers, self.stamps = [], {}, [], {}
        self.times = []
        self.channels = {}

    def until(self, found):
        """Take frames until ``found()`` is true; return it."""
        deadline = time.monotonic() + WITHIN
        while not (value := found()):
            self._take(self.socket.recv(timeout=deadline - time.monotonic()))
        return value

    def channel(self, topic):
        return self.until(lambda: self.channels.get(topic))

    def subscribe(self, *topics):
        channels = [self.channel(topic)["id"] for topic in topics]
        wanted = [{"id": 100 + number, "channelId": number} for number in channels]
        self.send({"op": "subscribe", "subscriptions": wanted})

    def newest(self, topic):
        return self.until(lambda: self.messages.get(topic))[-1]

    def operation(self, name):
        """Wait for the next operation of a kind, and take it."""
        found = self.until(lambda: [one for one in self.operations if one["op"] == name])[0]
        self.operations.remove(found)
        return found

    def publish(self, topic, message, number=7):
        self.send({"op": "advertise", "channels": [{"id": number, "topic": topic, "encoding": "json"}]})
        self.socket.send(struct.pack("<BI", 1, number) + json.dumps(message).encode())

    def call(self, service, encoding="json"):
        """Call a service; returns its answer."""
        found = self.until(lambda: [one for one in self.operations if one["op"] == "advertiseServices"])[0]
        number = next(one["id"] for one in found["services"] if one["name"] == service)
        text = encoding.encode()
        self.socket.send(struct.pack("<BIII", 2, number, 5, len(text)) + text + b"{}")
        return self.until(lambda: self.answers).pop()

    def send(self, operation):
        self.socket.send(operation if isinstance(operation, str | bytes) else json.dumps(operation))

    def _take(self, frame):
        if isinstance(frame, str):
            operation = json.loads(frame)
            self.operations.append(operation)
            if operation["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in operation["channels"]}
        elif frame[0] == 1:
            number, stamp = struct.unpack_from("<IQ", frame, 1)
            channel = next(one for one in self.channels.values() if one["id"] == number - 100)
            self.messages.setdefault(channel["topic"], []).append(decoded(channel, frame[13:]))
            self.stamps.setdefault(channel["topic"], []).append(stamp)
        elif frame[0] == 2:
            self.times.append(struct.unpack_from("<Q", frame, 1)[0])
        else:
            (length,) = struct.unpack_from("<I", frame, 9)
            self.answers.append(json.loads(frame[13 + length :]))


def decoded(channel, payload):
    if channel["encoding"] == "json":
        return json.loads(payload)
    schema = Schema(
        id=1, data=base64.b64decode(channel["schema"]), encoding="protobuf", name=channel["schemaName"]
    )  # fmt: skip
    return DecoderFactory().decoder_for("protobuf", schema)(payload)


class ServedRun:
    """A run on a thread of its own, from its making to its end; after the scenario's goals it waits for others."""

    def __init__(self, scenario, options, speed):
        self.notes, self.results, self.errors = [], [], []
        self._parameters = scenario, options, speed
        self._served, self._start, self._over = threading.Event(), threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        assert self._served.wait(WITHIN)
        if self.errors:
            raise self.errors[0]
        return self

    def start(self):
        """Let time pass and the goals be visited."""
        self._start.set()

    def __exit__(self, *exc):
        self._over.set()
        self._start.set()
        self._thread.join(WITHIN)
        assert not self._thread.is_alive() and not self.errors, self.errors

    def _run(self):
        scenario, options, speed = self._parameters
        try:
            with ExitStack() as closing:
                self.session = session = Session(scenario)
                closing.callback(session.close)
                sequence = GoalSequence(session, make_executive("move_base", session.navigator), stay=True)
                self.live = LiveFoxglove(session, sequence, options, speed, self.notes.append)
                closing.enter_context(self.live)
                session.loop.on_tick.append(lambda time: sequence.end("over") if self._over.is_set() else None)
                self._served.set()
                self._start.wait()
                session.run()
                self.results.append(sequence.visit_goals())
        except BaseException as error:
            self.errors.append(error)
        finally:
            self._served.set()

    def address(self, role=Role.STEER):
        return self.live.access.address(self.live.port, role).replace("http", "ws", 1)


@pytest.fixture
def served(meadow):
    """Serve runs; all are ended with the test."""
    with ExitStack() as closing:

        def serve(scenario=meadow, speed=0.0, start=True, **options):
            options = FoxgloveOptions(**{"port": 18765} | options)
            run = closing.enter_context(ServedRun(scenario, options, speed))
            if start:
                run.start()
            return run

        yield serve


@pytest.fixture
def client():
    """Connect clients; all are disconnected with the test."""
    with ExitStack() as closing:

        def make(run, role=Role.STEER, **fields):
            made = Client(run.address(role), **fields)
            closing.enter_context(made.socket)
            return made

        yield make


@pytest.fixture(scope="module")
def idle_app(meadow):
    """A client of a run that has not begun, for all cases together."""
    with ServedRun(meadow, FoxgloveOptions(port=18765), 0.0) as run:
        app = Client(run.address())
        with app.socket:
            yield app
