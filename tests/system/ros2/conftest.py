"""Real nodes of ROS 2 in processes of their own."""

import json
import signal
import subprocess
import threading
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.system.ros2.environments import JAZZY, KILTED, PEERS, clean_variables, end_with_parent, free_domain, profile

BRIEF_LEASE = profile("brief_lease")
WITHIN = 300.0  # s; nothing waits that long unless it fails
ROBOT = """
backend: costmap
controller_patience: 60.0
planner_patience: 60.0
max_vel_x: 0.5
global_costmap: {SIZE, layers: LAYERS, area: {zones: []}}
local_costmap: {SIZE, layers: LAYERS, area: {zones: []}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
recovery_behaviors: [{name: pause, type: wait}]
""".replace("LAYERS", "[{name: area, type: keepout}]").replace(
    "SIZE", "width: 80.0, height: 80.0, resolution: 0.2, origin_x: -40.0, origin_y: -40.0"
)


def start_as_from_a_terminal():
    """In a new process: it ends with this one, and SIGHUP is not ignored, also where the tests run under nohup."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    end_with_parent()


class Peer:
    """A process that writes JSON, one value a line, and takes orders on its standard input; its log is in ``logs``."""

    def __init__(self, folder, domain, logs, *command, program=None, before=(), **variables):
        program = program or str(folder / "venv" / "bin" / "python")
        self._log = open(logs / f"{Path(command[0]).stem}.txt", "a")
        self._over = False
        self.process = subprocess.Popen(
            [*before, program, *command],
            env={**clean_variables(folder, domain), "ROS_LOG_DIR": str(logs), **variables},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            preexec_fn=start_as_from_a_terminal,
        )
        self.lines = []
        self._condition = threading.Condition()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        for line in self.process.stdout:
            with self._condition:
                self.lines.append(json.loads(line) if line.startswith("{") else {"text": line.strip()})
                self._condition.notify_all()
        with self._condition:
            self._over = True
            self._condition.notify_all()

    def order(self, text):
        self.process.stdin.write(f"{text if isinstance(text, str) else json.dumps(text)}\n")
        self.process.stdin.flush()

    def wait_for(self, wanted, since=0):
        """Wait for a line of which ``wanted`` holds, among those after the first ``since``, and return it."""
        return self.wait_until(lambda: next((line for line in self.lines[since:] if wanted(line)), None))

    def wait_until(self, wanted):
        """Wait until something holds of the lines so far, or the process has written its last one; returns it."""
        with self._condition:
            self._condition.wait_for(lambda: wanted() or self._over, WITHIN)
            found = wanted()
            log = Path(self._log.name).read_text()[-3000:]
            assert found, f"{self.process.args[1:]} said at last {self.lines[-20:]}, and in its log {log}"
            return found

    def wait_for_end(self):
        """Wait for the end of the process; returns its code."""
        return self.process.wait(WITHIN)

    def wait_for_last_line(self):
        """Wait until nobody can write a line any more, neither the process nor its children."""
        self._thread.join(WITHIN)
        assert not self._thread.is_alive()

    def kill(self):
        """As kill -9 does."""
        self.process.kill()
        self.end()

    def end(self):
        self.process.kill()
        self.process.wait(WITHIN)
        self._thread.join(WITHIN)
        self.process.stdin.close()
        self.process.stdout.close()
        self._log.close()


class Robot(Peer):
    """The robot of ``peers/robot.py``."""

    def __init__(self, folder, domain, logs, *arguments):
        super().__init__(folder, domain, logs, str(PEERS / "robot.py"), *arguments)

    @property
    def x(self):
        """Where it was when the last command came [m]."""
        return next((line["x"] for line in reversed(self.lines) if "x" in line), 0.0)

    def set(self, topic, value):
        """Silence a topic ("off"), let it speak ("on"), or set simulated time; returns what it says then."""
        since = len(self.lines)
        self.order(f"{topic} {value}")
        return self.wait_for(lambda line: line.get("done") == f"{topic} {value}", since)

    def wait_until_last_speed_is_zero(self):
        """Wait until it was stopped; one that has never been moved gets no command to stop, either."""
        self.wait_until(lambda: [line["speed"] for line in self.lines if "speed" in line][-1:] in ([], [0.0]))

    def wait_until_it_stands(self, since):
        """Wait until it has stopped by itself, for want of commands; returns where."""
        return self.wait_for(lambda line: line.get("stood"), since)["x"]

    def wait_for_speed(self, wanted, since=0):
        return self.wait_for(lambda line: "speed" in line and wanted(line["speed"]), since)


class Client(Peer):
    """The client of ``peers/client.py``, or another one that takes the same kind of orders."""

    def __init__(self, folder, domain, logs, script="client.py"):
        super().__init__(folder, domain, logs, str(PEERS / script), **BRIEF_LEASE)
        self._keys = 0

    def do(self, **order):
        """Give an order, with a new key; returns the key."""
        self._keys += 1
        self.order({"key": str(self._keys), **order})
        return str(self._keys)

    def meet(self):
        """Wait until the client sees a node."""
        self.wait(self.do(order="meet"), "ready")

    def part(self):
        """Wait until the client sees no node any more."""
        self.wait(self.do(order="part"), "alone")

    def send(self, action, **fields):
        """Send a goal and wait until it is accepted; returns its key."""
        key = self.do(order="send", action=action, **fields)
        self.wait(key, "accepted")
        return key

    def put(self, name, value):
        """Set a parameter; returns what the node answers."""
        return self.wait(self.do(order="put", name=name, value=value), "set")

    def wait(self, key, what):
        return self.wait_for(lambda line: line.get("key") == key and line["what"] == what)

    def result(self, action, **fields):
        """Send a goal and wait for its result: status and outcome."""
        line = self.wait(self.send(action, **fields), "result")
        return line["status"], line["outcome"]


def folder_of(distribution):
    if reason := distribution.missing():
        pytest.skip(reason)
    return distribution.prepared()


@pytest.fixture(scope="session")
def ros_folder():
    """Folder of the environment with Kilted."""
    return folder_of(KILTED)


@pytest.fixture(scope="session")
def jazzy_folder():
    """Folder of the environment with Jazzy, mbf_msgs and tf2_msgs, and a rosbridge server."""
    return folder_of(JAZZY)


class Trio:
    """A robot, our node and a client, in a domain of DDS of their own, where they hear no other test."""

    def __init__(self, closing, folder, logs, module, node_folder=None, client_folder=None):
        self._closing, self._folder, self._logs = closing, folder, logs
        self._node_folder, self._client_folder = node_folder or folder, client_folder or folder
        self._domain = free_domain(folder.parent, closing)
        self._client = getattr(module, "CLIENT", "client.py")
        self._options = getattr(module, "OPTIONS", ())
        simulated = getattr(module, "SIMULATED", False)
        self._robot_arguments = ["simulated", "--ros-args", "-r", "odom:=wheel/odom"] if simulated else []
        given = ["--", "-p", "use_sim_time:=true", "-p", "odom_topic:=wheel/odom"]
        self._node_arguments = given if simulated else []
        self.file = logs / "robot.yaml"
        self.file.write_text(getattr(module, "CONFIG", ROBOT))
        self.start_robot()
        self.start_node()
        self.start_client()
        self.wait_until_ready()

    def start_robot(self):
        self.robot = self._start(Robot, *self._robot_arguments)

    def start_node(self, *options, before=()):
        arguments = *self._options, *options, *self._node_arguments
        command = str(PEERS / "node.py"), str(self.file), *arguments
        self.node = self._start(Peer, *command, folder=self._node_folder, before=before, **BRIEF_LEASE)

    def kill_node(self):
        """Kill the node, and wait until the client has noticed.

        Until the lease of the killed node ends, its servers seem to be there. A client that takes them for those of a
        new node sends its goal before it has discovered that one, and the goal is lost.
        """
        self.node.kill()
        self.client.part()

    def start_client(self):
        self.client = self._start(Client, self._client, folder=self._client_folder)

    def wait_until_ready(self, since=0):
        """Wait until the node says that it hears the robot, in a line after the first ``since``."""
        self.node.wait_for(lambda line: "is ready" in line.get("text", ""), since)
        self.client.meet()

    def drive(self):
        """Begin to drive to a place that is a minute away; returns the key of the goal."""
        start = len(self.robot.lines)
        goal = self.client.send("move_base", target=[-30.0 if self.robot.x > 0.0 else 30.0, 0.0])
        self.robot.wait_for_speed(lambda speed: speed > 0.0, start)
        return goal

    def cancel(self, goal):
        """Cancel a goal; returns its end."""
        self.client.order({"order": "cancel", "key": goal})
        return self.client.wait(goal, "result")

    def _start(self, kind, *arguments, folder=None, **variables):
        peer = kind(folder or self._folder, self._domain, self._logs, *arguments, **variables)
        self._closing.callback(peer.end)
        return peer


def pytest_generate_tests(metafunc):
    """Where a module has ``PAIRS`` of distributions, of the node and of the client, its tests run for each of them."""
    pairs = getattr(metafunc.module, "PAIRS", ())
    if pairs and "module_trio" in metafunc.fixturenames:
        metafunc.parametrize("module_trio", pairs, ids=" and ".join, indirect=True, scope="module")


@pytest.fixture(scope="module")
def module_trio(ros_folder, tmp_path_factory, request):
    """One trio for all tests of a module, on Kilted where it has no ``PAIRS``.

    On simulated time, with odometry on another topic, where the module has ``SIMULATED``; with the script of its
    ``CLIENT``, its ``CONFIG`` and its ``OPTIONS`` of the command, where it has them.
    """
    names = getattr(request, "param", ("kilted", "kilted"))
    folders = [request.getfixturevalue("jazzy_folder") if name == "jazzy" else ros_folder for name in names]
    with ExitStack() as closing:
        yield Trio(closing, ros_folder, tmp_path_factory.mktemp("trio"), request.module, *folders)


@pytest.fixture
def trio(module_trio):
    """The trio of the module, with a node that runs."""
    if module_trio.node.process.poll() is not None:
        module_trio.start_node()
        module_trio.wait_until_ready()
    return module_trio
