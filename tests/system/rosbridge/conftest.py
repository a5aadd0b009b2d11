"""A served navigator with scripted plugins and a loopback robot in real time, and real roslibpy clients of it."""

import json
import threading
from contextlib import ExitStack

import pytest
import roslibpy

from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_ros.rosbridge.server import ServerOptions
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session

WITHIN = 20.0  # s; nothing waits that long unless it fails


class Answers:
    """Values that arrive on another thread, waited for by a condition."""

    def __init__(self):
        self._condition = threading.Condition()
        self.values = []

    def __call__(self, value=None):
        with self._condition:
            self.values.append(value)
            self._condition.notify_all()

    def wait(self, count=1):
        """Wait for that many values and return them."""
        with self._condition:
            assert self._condition.wait_for(lambda: len(self.values) >= count, WITHIN), self.values
            return list(self.values)

    def wait_for(self, wanted):
        """Wait for a value of which ``wanted`` holds, and return it."""
        with self._condition:
            found = lambda: [value for value in self.values if wanted(value)]  # noqa: E731
            assert self._condition.wait_for(found, WITHIN), self.values
            return found()[0]


@pytest.fixture
def answers():
    return Answers


@pytest.fixture
def serving():
    """Serve any number of sessions in a test; all are closed at its end."""
    with ExitStack() as closing:

        def serve(session=None, robot=None, **options):
            session = session or ScriptedSession(clock=WallClock())
            closing.enter_context(session)
            server_options = ServerOptions(port=0, **options.pop("server", {}))
            server = closing.enter_context(serve_session(session, BridgeOptions(server_options, **options), robot))
            return session, server

        yield serve


@pytest.fixture
def connect():
    """Connect roslibpy clients; all are disconnected at the end."""
    clients = []

    def make(port):
        ros = roslibpy.Ros("127.0.0.1", port)
        ros.run(timeout=WITHIN)
        clients.append(ros)
        return ros

    yield make
    for ros in clients:
        ros.close(timeout=WITHIN)


@pytest.fixture
def raw():
    """Connect plain WebSockets; all are closed at the end."""
    from websockets.sync.client import connect as open_socket

    with ExitStack() as closing:

        def make(port, path="/", origin=None, **fields):
            address = f"ws://127.0.0.1:{port}{path}"
            socket = open_socket(address, origin=origin, open_timeout=WITHIN, close_timeout=1.0, **fields)
            return closing.enter_context(socket)

        yield make


@pytest.fixture
def ask():
    """Send an operation on a plain WebSocket and return the next frame that is of one of the given kinds."""

    def send(socket, operation, *kinds):
        socket.send(operation if isinstance(operation, str | bytes) else json.dumps(operation))
        while True:
            answer = json.loads(socket.recv(timeout=WITHIN))
            if answer["op"] in kinds:
                return answer

    return send
