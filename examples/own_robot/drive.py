"""Navigate a robot of one's own over serial lines: to one place, or to whatever place is written into a pipe.

    python drive.py robot.yaml --base /dev/ttyUSB0 --lidar /dev/ttyUSB1 --beacons /dev/ttyUSB2 --to 4.0 2.0
    python drive.py robot.yaml --base ... --lidar ... --beacons ... --goals /run/own_robot/goals
    echo 4.0 2.0 1.57 > /run/own_robot/goals

Ends with 0 after a goal that was reached, and with 1 where one is not, or where a line is cut: systemd starts it again.
What is wrong with the call, a device or the configuration is one line, and the exit code 2.
"""

import argparse
import os
import select
import socket
import stat
import sys
from contextlib import suppress

from devices import Base, Beacons, Device, Lidar
from serial_line import SerialLine

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.goals.goal_types import MoveBaseGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.program_end import interruptible

FIRST_WORD = 10.0  # s to wait for each device
CYCLE = 0.2  # s between two looks at lines, goals and the watchdog


def main(arguments: argparse.Namespace) -> int:
    """Start the devices and the navigator, then drive; the exit code."""
    clock, transforms = WallClock(), TransformBuffer()
    base = Base(SerialLine(arguments.base), clock, transforms)
    with Navigator.from_file(arguments.config, base, clock, transforms) as navigator:  # the robot stops at its end
        lidar = Lidar(SerialLine(arguments.lidar), clock, transforms, navigator.server.take_scan)
        beacons = Beacons(SerialLine(arguments.beacons), clock, transforms)
        devices = {"base": base, "beacons": beacons, "lidar": lidar}  # a scan is placed by the pose
        for name, device in devices.items():
            device.start()
            if not device.heard.wait(FIRST_WORD):
                print(device.lost or f"the {name} says nothing", file=sys.stderr)
                return 1
        here = navigator.robot_pose()
        navigator.server.warm_up(here, navigator.ground_pose(here.x + 1.0, here.y))  # compiled before it moves
        notify("READY=1")
        return (
            drive_to(navigator, arguments.to, devices) if arguments.to else serve(navigator, arguments.goals, devices)
        )


def drive_to(navigator: Navigator, place: list[float], devices: dict[str, Device]) -> int:
    """Drive to one place; the exit code."""
    handle = navigator.send(goal_at(navigator, place))
    while not handle.done:
        if lost := still_there(devices):
            return lost
        wait(handle)
    report(handle)
    return 0 if handle.wait().success else 1


def serve(navigator: Navigator, pipe: str, devices: dict[str, Device]) -> int:
    """Drive to the places that are written into a pipe, until a line is cut; a new place replaces the one before."""
    if not os.path.exists(pipe):
        os.mkfifo(pipe, 0o660)
    if not stat.S_ISFIFO(os.stat(pipe).st_mode):
        raise ValueError(f"--goals: expected a named pipe, got {pipe}")
    goals = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    while not (lost := still_there(devices)):
        ready, _, _ = select.select([goals], [], [], CYCLE)
        for line in os.read(goals, 4096).decode("ascii", "replace").splitlines() if ready else ():
            try:
                goal = goal_at(navigator, [float(word) for word in line.split()])
                navigator.send(goal).add_done_callback(report)
            except (ValueError, TypeError) as error:
                print(f"a goal is X Y [YAW] in m and rad, not {line!r}: {error}", file=sys.stderr)
    return lost


def goal_at(navigator: Navigator, place: list[float]) -> MoveBaseGoal:
    """Make the goal of a place; raises TypeError where the numbers are too few or too many."""
    return MoveBaseGoal(navigator.ground_pose(*place))


def report(handle: AnyGoalHandle) -> None:
    """Print how a goal has ended."""
    result = handle.wait()
    print(f"{result.outcome_name}: {result.message}", flush=True)


def wait(handle: AnyGoalHandle) -> None:
    """Wait for a cycle, or until the goal has ended."""
    try:
        handle.wait(CYCLE)
    except TimeoutError:
        pass


def still_there(devices: dict[str, Device]) -> int:
    """Feed systemd's watchdog while all lines are there; else the exit code."""
    if lost := [device.lost for device in devices.values() if device.lost]:
        print("; ".join(lost), file=sys.stderr)
        return 1
    notify("WATCHDOG=1")
    return 0


def notify(text: str) -> None:
    """Tell systemd (sd_notify) that the program lives; does nothing where it was not started by systemd."""
    if address := os.environ.get("NOTIFY_SOCKET"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as channel, suppress(BlockingIOError):
            channel.setblocking(False)  # a busy systemd must not stop the robot's program
            channel.sendto(text.encode(), address.replace("@", "\0", 1))


def device_there(path: str) -> str:
    """Check the name of a device."""
    if not os.path.exists(path):
        raise argparse.ArgumentTypeError(f"{path} is not there: is it plugged in?")
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config")
    for line in ("--base", "--lidar", "--beacons"):
        parser.add_argument(line, required=True, metavar="DEVICE", type=device_there)
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--to", nargs="+", type=float, metavar="X Y [YAW]", help="place [m, rad]")
    where.add_argument("--goals", metavar="PIPE", help="named pipe of places; made if it is not there")
    given = parser.parse_args()
    if given.to and len(given.to) not in (2, 3):
        parser.error(f"--to: expected X Y [YAW], got {len(given.to)} numbers")
    with interruptible():  # Ctrl-C stops the robot first
        try:
            sys.exit(main(given))
        except (ConfigError, OSError, ValueError) as error:  # what is wrong at the start
            parser.exit(2, f"{error}\n")
