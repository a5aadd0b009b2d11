"""A served navigator with scripted plugins and a loopback robot in real time, and real roslibpy clients of it.

And the other way round: a robot that is served, and a navigator that is its client.
"""

import json
import socket
import threading
from contextlib import ExitStack, suppress

import numpy as np
import pytest
import roslibpy
import trimesh

from mbf_abstract.access.server_options import ServerOptions
from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult
from mbf_abstract.server.factory import read_config
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.time.clock import WallClock
from mbf_mesh_nav.mesh.heightfield_mesh import heightfield_mesh
from mbf_ros.rosbridge.serving import BridgeOptions, serve_session
from mbf_ros.rosbridge_robot.navigator import connect_navigator
from mbf_ros.rosbridge_robot.options import RobotOptions
from mbf_ros.rosbridge_robot.simulated_robot import serve_robot

WITHIN = 20.0  # s; nothing waits that long unless it fails


def creep(request):
    """A controller's answer that never arrives."""
    return ControlResult(ExePathOutcome.SUCCESS, "driving", Twist.planar(0.02))


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


class Wire:
    """A cable between a navigator and its robot, as a TCP proxy, that can be cut and mended."""

    def __init__(self, port):
        self._target, self.whole, self._pairs, self._threads = port, True, [], []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._spawn(self._accept)

    def _spawn(self, target, *arguments):
        self._threads.append(threading.Thread(target=target, args=arguments, daemon=True))
        self._threads[-1].start()

    def _accept(self):
        with suppress(OSError):
            while True:
                near = self._listener.accept()[0]
                if not self.whole:
                    near.close()
                    continue
                pair = (near, socket.create_connection(("127.0.0.1", self._target)))
                self._pairs.append(pair)
                for one, other in (pair, pair[::-1]):
                    self._spawn(self._pass_on, one, other)

    def _pass_on(self, one, other):
        with suppress(OSError):
            while data := one.recv(65536):
                other.sendall(data)
        self._shut(one, other)
        one.close()

    @staticmethod
    def _shut(*sockets):
        for one in sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def cut(self):
        """End all connections, and let none through until ``mend``."""
        self.whole = False
        self.cut_once(slice(None))

    def cut_once(self, which):
        """End some of the connections, in the order in which they were opened; they may be opened again."""
        for pair in self._pairs[which]:
            self._shut(*pair)

    def mend(self):
        self.whole = True

    def close(self):
        self.cut()
        self._shut(self._listener)
        self._listener.close()
        for thread in self._threads:
            thread.join(WITHIN)


ROBOT = """
controller_patience: 60.0
planner_patience: 60.0
controllers: [{name: follow, type: follow_path}]
recovery_behaviors: [{name: pause, type: wait}]
"""
SIZE = "width: 40.0, height: 20.0, resolution: 0.2, layers: [{name: area, type: keepout}], area: {zones: []}"
ROBOTS = {
    "mesh": f"""{ROBOT}
backend: mesh
mesh_map: {{mesh_file: floor.ply, layers: [{{name: area, type: keepout}}], area: {{regions: []}}}}
planners: [{{name: shortest, type: dijkstra}}]
""",
    "costmap": f"""{ROBOT}
backend: costmap
global_costmap: {{{SIZE}}}
local_costmap: {{{SIZE}}}
planners: [{{name: shortest, type: straight_line}}]
""",
}


class Peers:
    """A robot behind a server of its own, a wire, and the navigator that is connected to it.

    ``driver_timeout``: time [s] without a command after which the robot stops by itself.
    """

    def __init__(self, closing, folder, backend, driver_timeout=0.5, **options):
        self._closing, self.config = closing, folder / f"{backend}.yaml"
        if backend == "mesh":
            floor = trimesh.Trimesh(*heightfield_mesh(np.zeros((21, 41)), 1.0, 1.0), process=False)
            floor.export(folder / "floor.ply")
        self.config.write_text(ROBOTS[backend])
        self.reports, self.report_raises = Answers(), None
        self.session = LoopbackSession(Pose.planar(1.0, 5.0), WallClock())
        driver = folder / "driver.yaml"
        driver.write_text(f"command_timeout: {driver_timeout}\n{ROBOTS[backend]}")
        self.session.serve(*read_config(driver), self.session.robot, self.session.transforms)
        closing.enter_context(self.session)
        self.robot = self.session.robot
        self.server = closing.enter_context(serve_robot(self.session, BridgeOptions(ServerOptions(port=0))))
        self.wire = Wire(self.server.port)
        closing.callback(self.wire.close)
        options = RobotOptions(**{"max_silence": 10.0, **options})
        address = f"ws://127.0.0.1:{self.wire.port}"
        self.navigator = closing.enter_context(connect_navigator(address, self.config, options, self._report))
        self.wait_until(lambda: not self.navigator.problem())

    def _report(self, text):
        if self.report_raises is not None:
            raise self.report_raises
        self.reports(text)

    def wait_until(self, holds):
        """Wait for a state that changes by itself and tells nobody."""
        deadline = self.session.clock.now() + WITHIN
        while not holds():
            assert self.session.clock.now() < deadline, (self.navigator.problem(), self.reports.values)
            self.session.clock.sleep(0.01)

    def commands(self):
        """Speeds of all commands that the robot has got."""
        return [command.speed for _, command in tuple(self.robot.commands)]

    @property
    def moves(self):
        return not self.robot.commands[-1][1].is_stopped() if self.robot.commands else False


@pytest.fixture
def peers(tmp_path):
    with ExitStack() as closing:
        yield lambda backend="costmap", **options: Peers(closing, tmp_path, backend, **options)
