"""A robot without ROS: a driver in plain Python, here for a base that speaks JSON over UDP.

The base sends where it is and how it moves, ten times a second or more, and takes speed and yaw rate::

    {"x": 1.0, "y": 2.0, "yaw": 0.5, "v": 0.3, "w": 0.0}        {"v": 0.3, "w": 0.0}

It must stop by itself when nothing has come for half a second. To go to (4, 2)::

    python examples/udp_driver.py my_robot.yaml 10.0.0.5:7000 4.0 2.0
"""

import argparse
import json
import socket
import sys
import threading

from mbf_abstract.config.findings import ConfigError
from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.navigator import Navigator
from mbf_abstract.time.clock import WallClock
from mbf_abstract.time.program_end import interruptible

FIRST_WORD, GREETING = 10.0, 0.5  # s to wait for the base, and between two greetings until it is heard


class UdpRobot:
    """The driver: ``send_command`` and ``odometry`` only pass on what is there, and never wait."""

    def __init__(self, base: tuple[str, int], clock: WallClock, transforms: TransformBuffer) -> None:
        self.heard = threading.Event()
        self._clock, self._transforms = clock, transforms
        self._odometry: Odometry | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(base)  # lets nobody else's datagrams in
        threading.Thread(target=self._listen, daemon=True).start()

    def wait_until_heard(self, timeout: float) -> bool:
        """Greet the base until it answers, at most ``timeout`` [s]; it learns where to send to."""
        end = self._clock.now() + timeout
        while not self.heard.is_set() and self._clock.now() < end:
            try:
                self.send_command(Twist())
            except OSError:
                pass  # it has not booted yet
            self.heard.wait(GREETING)
        return self.heard.is_set()

    def send_command(self, command: Command) -> None:
        """Send a command to the base; what cannot be sent is the gate's to try again."""
        assert isinstance(command, Twist)
        self._socket.send(json.dumps({"v": command.vx, "w": command.wz}).encode())

    def odometry(self) -> Odometry | None:
        """Return what came last; the navigator sees by its stamp when nothing comes any more."""
        return self._odometry

    def _listen(self) -> None:
        known = ""
        while True:
            try:
                self._take(json.loads(self._socket.recv(2000)))
            except (ValueError, KeyError, TypeError, OSError) as error:  # the next one may be fine
                if (text := f"{type(error).__name__}: {error}") != known:
                    print(f"from the base: {text}", file=sys.stderr)
                    known = text

    def _take(self, state: dict[str, float]) -> None:
        now = self._clock.now()
        pose = Pose.planar(state["x"], state["y"], state["yaw"])
        odometry = Odometry(Twist.planar(state["v"], wz=state["w"]), now)
        self._transforms.set(Transform.from_pose(pose.stamped(now), "base_link"))
        self._odometry = odometry
        self.heard.set()


def main(config: str, base: tuple[str, int], x: float, y: float) -> bool:
    clock, transforms = WallClock(), TransformBuffer()
    robot = UdpRobot(base, clock, transforms)
    with Navigator.from_file(config, robot, clock, transforms) as navigator:  # the robot stops at the end of the block
        if not robot.wait_until_heard(FIRST_WORD):
            print(f"{base[0]}:{base[1]} is silent", file=sys.stderr)
            return False
        navigator.server.warm_up(navigator.robot_pose(), navigator.ground_pose(x, y))
        result = navigator.go_to(navigator.ground_pose(x, y))
        print(f"{result.outcome_name}: {result.message}")
        return result.success


def address(text: str) -> tuple[str, int]:
    """Read the base's address, and look its name up."""
    host, _, port = text.rpartition(":")
    if not (host and port.isdecimal() and 0 < int(port) < 65536):
        raise argparse.ArgumentTypeError(f"expected HOST:PORT, got {text!r}")
    try:
        return socket.gethostbyname(host), int(port)
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{host}: {error.strerror}") from None


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config")
    parser.add_argument("base", type=address, metavar="HOST:PORT")
    for axis in ("x", "y"):
        parser.add_argument(axis, type=float, help="of the goal [m]")
    given = parser.parse_args()
    with interruptible():  # Ctrl-C stops the robot first
        try:
            sys.exit(0 if main(given.config, given.base, given.x, given.y) else 1)
        except (ConfigError, ValueError) as error:
            parser.exit(2, f"{error}\n")
