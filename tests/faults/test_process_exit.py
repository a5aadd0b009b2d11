"""Fault table, row 32: Ctrl-C, SIGTERM, SIGHUP, an exception in the main thread, the end of the interpreter, a fork.

Each test runs a small robot program in a process of its own. Its robot writes every command to a file at once, so the
file shows the last command to the robot, however the process ended.
"""

import os
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest

from mbf_abstract.goals.goal_types import ExePathGoal
from mbf_abstract.testing.scripted_session import ScriptedSession

PROGRAM = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets its background jobs ignore it
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # and nohup lets its program ignore this one
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal
from mbf_abstract.time.clock import WallClock
from mbf_abstract.testing.scripted_session import ScriptedSession
from mbf_abstract.testing.faulty import BusyHang, Hang, drive

class Robot:
    '''Writes each command down, unbuffered.'''
    def __init__(self, path):
        self.file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    def send_command(self, command):
        os.write(self.file, f"{command.vx}\\n".encode())
    def odometry(self):
        return None

def run(path, hang=False):
    session = ScriptedSession(clock=WallClock(), robot=Robot(path), tf_timeout=60.0)
    if hang:
        session.controller.play(drive(), drive(), Hang(session.clock))
    else:
        session.controller.play(drive())
    session.navigator.send(ExePathGoal(session.path_to(50.0)))
    session.clock.sleep(0.3)
    print("driving", flush=True)
    return session

def plan_for_long(session):
    session.planner.play(Hang(session.clock))
    return session.navigator.send(GetPathGoal(session.robot.pose))
"""
ENDS = {
    "end of the program": "session = run(sys.argv[1])",
    "sys.exit": "session = run(sys.argv[1]); sys.exit(3)",
    "exception": "session = run(sys.argv[1]); raise RuntimeError('user code')",
    "hanging plugin": "session = run(sys.argv[1], hang=True)",
    "context manager": "\nwith run(sys.argv[1]) as session:\n    raise RuntimeError('user code')",
}


@contextmanager
def start(program, log):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", PROGRAM + program, str(log)]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=Path.cwd()
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def velocities(log):
    return [float(line) for line in log.read_text().split()]


@pytest.mark.parametrize("end", ENDS)
def test_however_the_process_ends_the_robot_is_sent_zero(tmp_path, end):
    log = tmp_path / "commands"
    with start(ENDS[end], log) as process:
        output, _ = process.communicate(timeout=20)
    assert "driving" in output
    assert 0.5 in velocities(log)
    assert velocities(log)[-1] == 0.0


def test_ctrl_c_stops_the_robot(tmp_path):
    log = tmp_path / "commands"
    with start("session = run(sys.argv[1]); session.clock.sleep(60.0)", log) as process:
        assert process.stdout.readline().strip() == "driving"
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)
    assert velocities(log)[-1] == 0.0


WAITS = {
    "sleep": "session = run(sys.argv[1]); session.clock.sleep(60.0)",
    "context manager": "\nwith run(sys.argv[1]) as session:\n    session.clock.sleep(60.0)",
    "wait": "session = run(sys.argv[1]); plan_for_long(session).wait()",
    "hanging plugin": "session = run(sys.argv[1], hang=True); session.clock.sleep(60.0)",
    "asyncio": """
import asyncio
async def main():
    await plan_for_long(session)
session = run(sys.argv[1])
asyncio.run(main())
""",
    "lock of the gate": """
session = run(sys.argv[1])
with session.server.runtime.gate._condition:  # as if the signal came in the middle of a command
    session.clock.sleep(60.0)
""",
    "exit that is refused": """
clock = WallClock()
try:
    session = run(sys.argv[1])
    clock.sleep(60.0)
except SystemExit:
    clock.sleep(1.0)
    os._exit(7)  # neither with, nor finally, nor atexit
""",
}


@pytest.mark.parametrize("wait", WAITS)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_the_process_stops_the_robot_first(tmp_path, number, wait):
    log = tmp_path / "commands"
    with start(WAITS[wait], log) as process:
        assert process.stdout.readline().strip() == "driving"
        process.send_signal(number)
        process.communicate(timeout=20)
    assert velocities(log)[-1] == 0.0
    assert process.returncode == (7 if "refused" in wait else 128 + number)


def test_a_handler_of_the_program_itself_is_left_alone_and_comes_back_after_the_last_server(tmp_path):
    log = tmp_path / "commands"
    program = """
own = lambda number, frame: os.write(1, b"mine\\n")
signal.signal(signal.SIGHUP, own)
session = run(sys.argv[1])
os.kill(os.getpid(), signal.SIGHUP)
other = ScriptedSession(clock=WallClock())
print(signal.getsignal(signal.SIGTERM) is signal.SIG_DFL, flush=True)
session.close()
print(signal.getsignal(signal.SIGTERM) is signal.SIG_DFL, flush=True)
other.close()
print(signal.getsignal(signal.SIGTERM) is signal.SIG_DFL, signal.getsignal(signal.SIGHUP) is own, flush=True)
"""
    with start(program, log) as process:
        output, _ = process.communicate(timeout=20)
    assert output.split() == ["driving", "mine", "False", "False", "True", "True"]


def test_a_forked_child_that_is_terminated_ends_and_its_parents_robot_drives_on(tmp_path):
    log = tmp_path / "commands"
    program = """
import time
session = run(sys.argv[1])
begun, begin = os.pipe()
child = os.fork()
if child == 0:
    os.write(begin, b"!")  # Python drops signals that come while it forks
    time.sleep(60.0)
    os._exit(0)
os.read(begun, 1)
os.kill(child, signal.SIGTERM)
_, status = os.waitpid(child, 0)
print(os.WTERMSIG(status), flush=True)
os.write(session.server.runtime.gate._writer._robot.file, b"9\\n")
session.clock.sleep(0.2)
"""
    with start(program, log) as process:
        output, _ = process.communicate(timeout=20)
    reported = velocities(log)
    assert output.split() == ["driving", str(int(signal.SIGTERM))]
    assert 0.0 not in reported[: reported.index(9.0)]
    assert reported[-1] == 0.0


def test_a_forked_child_that_ends_does_not_stop_or_drive_the_robot(tmp_path):
    log = tmp_path / "commands"
    program = """
session = run(sys.argv[1])
child = os.fork()
if child == 0:
    sys.exit(0)
os.waitpid(child, 0)
os.write(session.server.runtime.gate._writer._robot.file, b"9\\n")
session.clock.sleep(0.2)
"""
    with start(program, log) as process:
        process.communicate(timeout=20)
    reported = velocities(log)
    child_ended = reported.index(9.0)
    assert 0.0 not in reported[:child_ended]
    assert reported[-1] == 0.0


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_ctrl_c_in_the_middle_of_the_last_command_is_passed_on_and_zero_follows(error):
    class Driver:
        robot = None
        interrupted = False

        def send_command(self, command):
            if threading.current_thread() is threading.main_thread() and not self.interrupted:
                self.interrupted = True
                raise error
            self.robot.send_command(command)

        def odometry(self):
            return self.robot.odometry()

    driver = Driver()
    session = ScriptedSession(robot=driver, command_timeout=0.2)
    driver.robot = session.robot
    handle = session.navigator.send(ExePathGoal(session.path_to(50.0)))
    session.clock.sleep(1.0)
    with pytest.raises(error):
        session.server.close()
    assert driver.interrupted
    assert handle.wait(2.0).message == "the server is shut down"
    session.clock.sleep(1.0)
    assert session.robot.command.is_stopped()
    session.close()
    assert set(session.clock.thread_names) == {"main"}
