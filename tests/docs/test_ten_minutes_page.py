"""The page "Your robot in ten minutes", its driver, its unit and its container file do what they say."""

import configparser
import importlib.util
import json
import math
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from fnmatch import fnmatch
from pathlib import Path

import pytest

from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import WallClock
from mbf_ros.messages.nav2.behaviors import BEHAVIORS
from mbf_ros.ros2 import nav2
from mbf_ros.rosbridge.navigation import ACTIONS, NODE

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "ten_minutes.md").read_text("utf-8")
DEPLOY = ROOT / "examples" / "deploy"
PERIOD, WATCHDOG = 0.02, 0.5  # s


class Base(threading.Thread):
    """A base that speaks JSON over UDP, moves as it is asked, and stops by itself when nothing comes."""

    def __init__(self):
        super().__init__(daemon=True)
        self.state = dict.fromkeys(("x", "y", "yaw", "v", "w"), 0.0)
        self.last_command = {}
        self.over = threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(PERIOD)
        self.port = self._socket.getsockname()[1]

    def run(self):
        driver, last, now = None, 0.0, time.monotonic()
        while not self.over.is_set():
            try:
                data, driver = self._socket.recvfrom(2000)
                self.last_command = json.loads(data)
                self.state |= self.last_command
                last = time.monotonic()
            except TimeoutError:
                pass
            before, now = now, time.monotonic()
            if now - last > WATCHDOG:
                self.state |= {"v": 0.0, "w": 0.0}
            self._move(now - before)
            if driver is not None:
                self._socket.sendto(json.dumps(self.state).encode(), driver)

    def close(self):
        self._socket.close()

    def _move(self, step):
        one = self.state
        one["yaw"] += one["w"] * step
        one["x"] += one["v"] * math.cos(one["yaw"]) * step
        one["y"] += one["v"] * math.sin(one["yaw"]) * step


@pytest.fixture
def base():
    base = Base()
    base.start()
    yield base
    base.over.set()
    base.join(20.0)
    base.close()


@pytest.fixture
def config(tmp_path):
    """The configuration of the page, for a robot that may be quick."""
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    file = tmp_path / "robot.yaml"
    file.write_text(text.replace("max_vel_x: 0.3", "max_vel_x: 1.0"))
    return str(file)


@pytest.mark.timeout(300)  # the driver compiles its kernels on a machine that has none
def test_the_driver_takes_a_base_to_its_goal_with_the_configuration_of_the_page(base, config):
    driver = [sys.executable, str(ROOT / "examples" / "udp_driver.py"), config, f"127.0.0.1:{base.port}", "1.0", "0.2"]
    ended = subprocess.run(driver, capture_output=True, text=True, timeout=250)

    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ended.stdout.startswith("SUCCESS")
    assert math.hypot(base.state["x"] - 1.0, base.state["y"] - 0.2) < 0.4
    assert base.state["v"] == base.state["w"] == 0.0


@pytest.mark.timeout(300)
def test_ctrl_c_stops_the_base_before_the_driver_ends_with_one_line(base, config):
    driver = [sys.executable, str(ROOT / "examples" / "udp_driver.py"), config, f"127.0.0.1:{base.port}", "9.0", "0.2"]
    process = subprocess.Popen(
        driver,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # which a shell lets its jobs ignore
    )
    while base.state["v"] < 0.1:
        assert process.poll() is None, process.communicate()
        time.sleep(PERIOD)
    process.send_signal(signal.SIGINT)
    printed, errors = process.communicate(timeout=60)

    assert (process.returncode, printed, errors) == (130, "", "interrupted\n")
    base.over.set()
    base.join(20.0)
    assert base.last_command == {"v": 0.0, "w": 0.0}


def test_the_driver_survives_rubbish_and_strangers_and_greets_a_base_that_boots_late():
    spec = importlib.util.spec_from_file_location("udp_driver", ROOT / "examples" / "udp_driver.py")
    driver = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(driver)
    clock, transforms = WallClock(), TransformBuffer()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as base:
        base.bind(("127.0.0.1", 0))
        robot = driver.UdpRobot(base.getsockname(), clock, transforms)
        taken, take = [], robot._take
        robot._take = lambda state: (taken.append(state), take(state))
        greeting = threading.Thread(target=robot.wait_until_heard, args=(60.0,))
        greeting.start()
        greetings = [base.recvfrom(2000) for _ in range(2)]  # the first one is lost
        address = ("127.0.0.1", greetings[-1][1][1])
        state = dict.fromkeys(("x", "y", "yaw", "v", "w"), 0.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.sendto(json.dumps(state | {"v": 9.0}).encode(), address)
        for wrong in (b"{", b"[]", b"{}", b"\xff", b'{"x": NaN, "y": 0, "yaw": 0, "v": 0, "w": 0}', b'{"x": "here"}'):
            base.sendto(wrong, address)
        base.sendto(json.dumps(state | {"v": 0.5}).encode(), address)
        greeting.join(60.0)

    assert (
        robot.heard.is_set()
        and [state["v"] for state in taken if "v" in state][-1] == 0.5 == robot.odometry().velocity.vx
    )
    assert all(state["v"] != 9.0 for state in taken if "v" in state), "a stranger is not listened to"


def test_the_unit_can_be_read_by_systemd_and_stops_the_robot_first(tmp_path):
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    text = (DEPLOY / "mbf.service").read_text("utf-8")
    unit.read_string(text)
    service = unit["Service"]

    assert (service["KillSignal"], service["Restart"]) == ("SIGTERM", "on-failure")
    assert unit["Unit"]["StartLimitIntervalSec"] == "0", "it never gives up on a rosbridge that is slow to start"
    assert f"useradd --system {service['User']}" in text and f"useradd --system {service['User']}" in PAGE
    assert float(service["TimeoutStopSec"]) > 2.0, "goals and the last command need some time"
    assert "bridge connect ws://" in service["ExecStart"] and unit["Install"]["WantedBy"]
    if (tool := shutil.which("systemd-analyze")) is not None:
        (tmp_path / "mbf.service").write_text(re.sub(r"/opt/mbf/bin/mbf", "/bin/true", text))
        found = subprocess.run(
            [tool, "verify", "--man=no", str(tmp_path / "mbf.service")], capture_output=True, text=True, timeout=60
        )
        assert "mbf.service" not in found.stderr, found.stderr


def test_the_container_has_the_commands_of_the_readme_and_gets_signals_itself():
    text = (DEPLOY / "Containerfile").read_text("utf-8")
    venv = re.search(r"python3 -m venv \S+ && \. \S+", (ROOT / "README.md").read_text("utf-8"))
    command = json.loads(re.search(r"^CMD (.*)$", text, re.MULTILINE).group(1))
    extras = re.search(r"pip install '\.\[(.*?)\]'", text).group(1).split(",")
    known = (ROOT / "pyproject.toml").read_text("utf-8")

    assert venv.group(0) in text and "STOPSIGNAL SIGTERM" in text and "USER mbf" in text
    assert command[:3] == ["mbf", "bridge", "connect"]
    (run,) = re.findall(r"^# (podman run .*)$", text, re.MULTILINE)
    assert run in PAGE and {"--init", "--restart"} <= set(run.split()) and "--rm" not in run
    ignored = (DEPLOY / "Containerfile.containerignore").read_text("utf-8").split()
    packages = re.search(r"^packages = \[(.*?)\]", known, re.MULTILINE | re.DOTALL).group(1)
    assert "*" in ignored and all(
        any(fnmatch(name, one[1:]) for one in ignored if one[0] == "!") for name in re.findall(r'"(\w+)"', packages)
    )
    assert all(f"\n{extra} = [" in known for extra in extras)
    assert " ".join(command) in (DEPLOY / "mbf.service").read_text("utf-8").replace("/opt/mbf/bin/", "")


def test_the_table_of_names_is_what_is_served():
    rows = re.findall(r"^\| (.*?) \| (.*?) \| `navigator\.(\w+)` \|$", PAGE, re.MULTILINE)
    ours = {name for row in rows for name in re.findall(r"`(\w+)`", row[0])}
    nav2_names = {name for row in rows for name in re.findall(r"`(\w+)`", row[1])}

    assert {f"{NODE}/{name}" for name in ours} == {name for name in ACTIONS if name.startswith(NODE)}
    assert nav2_names == {*nav2.ACTIONS, *BEHAVIORS}
    assert all(callable(getattr(Navigator, row[2])) for row in rows)
