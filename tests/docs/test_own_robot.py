"""The robot in pure Python of the guide: its program drives a base over real serial lines (pseudo-terminals)."""

import configparser
import contextlib
import importlib
import math
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from mbf_abstract.cli import make_app

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "own_robot"
PERIOD, WATCHDOG, SCAN_EVERY = 0.02, 0.5, 5  # s, s, periods
ROOM = (6.0, 4.0)  # m
BOX, BOX_RADIUS = (3.0, 1.0), 0.25  # m, on no map
START, GOAL = (1.0, 1.0), (5.0, 1.0)
RAYS = 120


@pytest.fixture(scope="module", autouse=True)
def example_on_the_path():
    sys.path.insert(0, str(EXAMPLE))
    yield
    sys.path.remove(str(EXAMPLE))


class Firmware(threading.Thread):
    """Base, lidar and beacons behind pseudo-terminals; the base stops by itself when no command comes."""

    def __init__(self):
        super().__init__(daemon=True)
        self.lines = {name: os.openpty() for name in ("base", "lidar", "beacons")}
        for _, ours in self.lines.values():
            tty.setraw(ours)
        for theirs, _ in self.lines.values():
            os.set_blocking(theirs, False)
        self.x, self.y, self.yaw, self.v, self.w = *START, 0.0, 0.0, 0.0
        self.nearest = math.inf
        self.commands = []
        self.over, self.moves = threading.Event(), threading.Event()
        self.loses = ""  # the line whose plug is pulled once it moves
        self.rest, self.heard = b"", time.monotonic()

    def device(self, name):
        return os.ttyname(self.lines[name][1])

    def pull(self, name):
        """Cut a line, as if its plug were pulled."""
        for end in self.lines.pop(name):
            os.close(end)

    def run(self):
        for cycle in range(1_000_000):
            if self.over.wait(PERIOD):
                return
            self.listen()
            if time.monotonic() - self.heard > WATCHDOG:
                self.v = self.w = 0.0
            self.move()
            if self.loses in self.lines and self.moves.is_set():
                self.pull(self.loses)
            self.say(
                "base", f"O {self.x - START[0]:.4f} {self.y - START[1]:.4f} {self.yaw:.4f} {self.v:.3f} {self.w:.3f}"
            )
            if cycle % SCAN_EVERY == 0:
                self.say("lidar", " ".join(["L", "-3.1416", f"{2 * math.pi / RAYS:.5f}", *self.ranges()]))
                self.say("beacons", f"P {self.x:.4f} {self.y:.4f} {self.yaw:.4f}")

    def listen(self):
        """Take the commands that have come."""
        try:
            *lines, self.rest = (self.rest + os.read(self.lines["base"][0], 65536)).split(b"\n")
        except BlockingIOError:
            return
        for line in lines:
            _, self.v, self.w = (word if i == 0 else float(word) for i, word in enumerate(body(line).split()))
            self.commands.append((self.v, self.w))
            self.heard = time.monotonic()

    def last_command(self):
        """End, and return the last command of a program that has ended, also one that was not listened to yet."""
        self.over.set()
        self.join(60.0)
        assert not self.is_alive()
        self.listen()
        return self.commands[-1]

    def move(self):
        self.yaw += self.w * PERIOD
        self.x += self.v * math.cos(self.yaw) * PERIOD
        self.y += self.v * math.sin(self.yaw) * PERIOD
        self.nearest = min(self.nearest, math.dist((self.x, self.y), BOX) - BOX_RADIUS)
        if self.v > 0.1:
            self.moves.set()

    def ranges(self):
        """Distances of the walls and of the round box from the lidar, 0.1 m ahead of the middle."""
        x, y = self.x + 0.1 * math.cos(self.yaw), self.y + 0.1 * math.sin(self.yaw)
        angles = self.yaw - math.pi + 2 * math.pi / RAYS * np.arange(RAYS)
        cos, sin = np.cos(angles), np.sin(angles)
        walls = np.minimum(
            np.where(cos > 0, ROOM[0] - x, x) / np.maximum(np.abs(cos), 1e-9),
            np.where(sin > 0, ROOM[1] - y, y) / np.maximum(np.abs(sin), 1e-9),
        )
        along = (BOX[0] - x) * cos + (BOX[1] - y) * sin
        beside = np.abs((BOX[0] - x) * sin - (BOX[1] - y) * cos)
        box = along - np.sqrt(np.maximum(BOX_RADIUS**2 - beside**2, 0.0))
        seen = np.where((along > 0) & (beside < BOX_RADIUS), np.minimum(walls, box), walls)
        return [f"{distance:.3f}" for distance in seen]

    def say(self, name, text):
        if name in self.lines:
            total = 0
            for byte in text.encode():
                total ^= byte
            with contextlib.suppress(BlockingIOError):  # nobody listens, and the line is full: it is lost, as on a wire
                os.write(self.lines[name][0], f"{text}*{total:02X}\r\n".encode())


def body(line):
    return line.decode().rpartition("*")[0]


@pytest.fixture
def firmware():
    robot = Firmware()
    robot.start()
    yield robot
    robot.over.set()
    robot.join(20.0)
    for name in list(robot.lines):
        robot.pull(name)


@pytest.fixture
def config(tmp_path):
    """A starter configuration for a map of the room; the robot may be quick."""
    pixels = np.full((80, 120), 254, np.uint8)
    pixels[[0, -1]], pixels[:, [0, -1]] = 0, 0
    Image.fromarray(pixels).save(tmp_path / "room.png")
    (tmp_path / "room.yaml").write_text(
        "image: room.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    arguments = ["config", "costmap_differential", "--map", str(tmp_path / "room.yaml")]
    text = CliRunner().invoke(make_app(), arguments).output
    file = tmp_path / "robot.yaml"
    file.write_text(re.sub(r"max_vel_x: 0.3", "max_vel_x: 0.8", text))
    return file


def drive(firmware, config, *where, **variables):
    lines = [word for name in ("base", "lidar", "beacons") for word in (f"--{name}", firmware.device(name))]
    command = [sys.executable, EXAMPLE / "drive.py", config, *lines, *where]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **variables},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # which a shell lets its jobs ignore
    )


@pytest.mark.timeout(300)  # kernels are compiled on a machine that has none
def test_the_robot_drives_around_a_box_that_is_on_no_map_and_feeds_the_watchdog(firmware, config, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(200.0)
        process = drive(firmware, config, "--to", *map(str, GOAL), NOTIFY_SOCKET=str(tmp_path / "notify"))
        told = [systemd.recv(100) for _ in range(2)]
        printed, errors = process.communicate(timeout=200)

    assert process.returncode == 0 and printed.startswith("SUCCESS"), printed + errors
    assert told == [b"READY=1", b"WATCHDOG=1"]
    assert math.dist((firmware.x, firmware.y), GOAL) < 0.25
    assert firmware.nearest > 0.2, "the robot's radius"
    assert firmware.last_command() == (0.0, 0.0)


@pytest.mark.timeout(300)
def test_the_service_takes_goals_from_a_pipe_and_ends_with_the_robot_standing_when_a_plug_is_pulled(
    firmware, config, tmp_path
):
    pipe = tmp_path / "goals"
    os.mkfifo(pipe)
    firmware.loses = "lidar"
    process = drive(firmware, config, "--goals", str(pipe))
    with pipe.open("w") as goals:
        goals.write("4.0 two\n5.0 1.0\n")
    printed, errors = process.communicate(timeout=250)

    assert process.returncode == 1, printed + errors
    assert "a goal is X Y [YAW] in m and rad, not '4.0 two'" in errors
    assert "is lost" in errors and "SUCCESS" not in printed
    assert firmware.last_command() == (0.0, 0.0)
    assert math.dist((firmware.x, firmware.y), GOAL) > 0.5, "it stood before it was there"


@pytest.mark.timeout(300)
def test_ctrl_c_stops_the_robot_before_the_program_ends_with_one_line(firmware, config):
    process = drive(firmware, config, "--to", *map(str, GOAL))
    assert firmware.moves.wait(250), process.communicate()
    process.send_signal(signal.SIGINT)
    printed, errors = process.communicate(timeout=60)

    assert (process.returncode, printed) == (130, "") and errors.endswith("interrupted\n"), errors
    assert "Traceback" not in errors
    assert firmware.last_command() == (0.0, 0.0)


@pytest.mark.parametrize(("name", "text"), [("plain.txt", "is no serial line"), (".", "Is a directory: ")])
def test_what_is_no_serial_line_is_named_in_one_line(tmp_path, name, text):
    (tmp_path / "plain.txt").write_text("hello")
    lines = [word for line in ("--base", "--lidar", "--beacons") for word in (line, str(tmp_path / name))]
    command = [sys.executable, EXAMPLE / "drive.py", "robot.yaml", *lines, "--to", "1", "2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)

    assert done.returncode == 2 and text in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_noise_and_half_a_line_do_not_get_through():
    serial_line = importlib.import_module("serial_line")
    master, slave = os.openpty()
    line = serial_line.SerialLine(os.ttyname(slave))
    os.write(
        master, b"2 3.0*11\n\xff\xfe*00\nO 1.0*00\nO 1.0*" + f"{serial_line.checksum('O 1.0'):02X}".encode() + b"\r\n"
    )

    assert next(line.messages()) == ["O", "1.0"]
    line.write("V 0.300 0.000")
    assert os.read(master, 100) == f"V 0.300 0.000*{serial_line.checksum('V 0.300 0.000'):02X}\n".encode()
    os.close(slave)
    os.close(master)
    with pytest.raises(OSError):
        next(line.messages())


def test_the_unit_can_be_read_by_systemd_and_starts_the_program_with_its_options(tmp_path):
    text = (EXAMPLE / "own_robot.service").read_text("utf-8")
    unit = configparser.ConfigParser(strict=False, interpolation=None)
    unit.optionxform = str
    unit.read_string(text)
    service, program = unit["Service"], (EXAMPLE / "drive.py").read_text("utf-8")

    assert (service["Type"], service["KillSignal"], service["Restart"]) == ("notify", "SIGTERM", "on-failure")
    assert all(f'"{option}"' in program for option in re.findall(r"--\w+", service["ExecStart"]))
    assert float(service["WatchdogSec"]) > 1.0 and "READY=1" in program and "WATCHDOG=1" in program
    if (tool := shutil.which("systemd-analyze")) is not None:
        (tmp_path / "own_robot.service").write_text(text.replace("/opt/mbf/bin/python", "/bin/true"))
        command = [tool, "verify", "--man=no", str(tmp_path / "own_robot.service")]
        found = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert "own_robot.service" not in found.stderr, found.stderr
