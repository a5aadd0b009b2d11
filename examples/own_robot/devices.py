"""The devices of a robot of one's own: a base, a lidar and beacons that say where it is, each on a serial line.

====================  =========================================================================
``O x y yaw v w``     the base, 50 times a second: odometry since it was switched on
``V v w``             to the base: speed and yaw rate; without one for 0.5 s it stops by itself
``L angle step r..``  the lidar, 10 times a second: its ranges [m], 0 where nothing was in range
``P x y yaw``         the beacons, 10 times a second: where base_link is on the map
====================  =========================================================================
"""

import math
import sys
import threading
from collections.abc import Callable

import numpy as np
from serial_line import SerialLine

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.geometry import Command, Pose, Twist
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.time.clock import Clock

LIDAR_AT = Transform((0.1, 0.0, 0.2), parent="base_link", child="scan", static=True)  # m; where it is screwed on
MAX_RANGE = 8.0  # m


class Device:
    """Listens to a serial line on a thread of its own, which ends with the line."""

    def __init__(self, line: SerialLine, clock: Clock, transforms: TransformBuffer) -> None:
        self.heard = threading.Event()
        self.lost = ""
        self._line, self._clock, self._transforms = line, clock, transforms

    def start(self) -> None:
        """Listen from now on."""
        threading.Thread(target=self._listen, daemon=True).start()

    def take(self, kind: str, numbers: list[float]) -> None:
        """Take one message."""
        raise NotImplementedError

    def _listen(self) -> None:
        known = ""
        try:
            for kind, *words in filter(None, self._line.messages()):
                try:
                    self.take(kind, [float(word) for word in words])
                except (ValueError, TransformError) as error:  # the next message may be fine
                    if type(error).__name__ != known:
                        print(f"{self._line.device}: {error}", file=sys.stderr)
                        known = type(error).__name__
        except OSError as error:
            self.lost = f"{self._line.device} is lost: {error}"


class Base(Device):
    """The robot as the navigator knows it: ``send_command`` and ``odometry``, which never wait."""

    _odometry: Odometry | None = None

    def send_command(self, command: Command) -> None:
        """Send a command; what cannot be sent is the gate's to try again."""
        assert isinstance(command, Twist)
        self._line.write(f"V {command.vx:.3f} {command.wz:.3f}")

    def odometry(self) -> Odometry | None:
        """Return what came last; the navigator sees by its stamp when nothing comes any more."""
        return self._odometry

    def take(self, kind: str, numbers: list[float]) -> None:
        """Take ``O``: where the wheels have taken it, and how fast it moves."""
        x, y, yaw, v, w = numbers
        now = self._clock.now()
        pose = Pose.planar(x, y, yaw, frame_id="odom", stamp=now)
        self._transforms.set(Transform.from_pose(pose, "base_link"))
        self._odometry = Odometry(Twist.planar(v, wz=w), now)
        self.heard.set()


class Lidar(Device):
    """Hands every scan to the maps, which place it by the transforms of its moment."""

    def __init__(
        self, line: SerialLine, clock: Clock, transforms: TransformBuffer, take_scan: Callable[[RangeScan], None]
    ) -> None:
        super().__init__(line, clock, transforms)
        self._take_scan = take_scan
        transforms.set(LIDAR_AT)

    def take(self, kind: str, numbers: list[float]) -> None:
        """Take ``L``: rays that hit nothing are free as far as the lidar looks."""
        first, step, *ranges = numbers
        distances = np.array(ranges)
        hits = (distances > 0.0) & (distances < MAX_RANGE)
        angles = first + step * np.arange(len(distances))
        lengths = np.where(hits, distances, MAX_RANGE)
        ends = np.column_stack([lengths * np.cos(angles), lengths * np.sin(angles), np.zeros(len(angles))])
        self._take_scan(RangeScan.of_rays("scan", (0.0, 0.0, 0.0), ends, hits, self._clock.now(), LIDAR_AT.child))
        self.heard.set()


class Beacons(Device):
    """The pose source: corrects the odometry, so that ``map -> odom -> base_link`` is where the robot is."""

    def take(self, kind: str, numbers: list[float]) -> None:
        """Take ``P``; raises TransformError before the first odometry."""
        x, y, yaw = numbers
        now = self._clock.now()
        on_map = Transform.from_pose(Pose.planar(x, y, math.remainder(yaw, math.tau), stamp=now), "base_link")
        driven = self._transforms.lookup("odom", "base_link")
        correction = on_map @ driven.inverse()
        self._transforms.set(Transform(correction.translation, correction.rotation, "map", "odom", now))
        self.heard.set()
