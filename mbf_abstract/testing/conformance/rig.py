"""The world of a backend under test: a simulated clock, a loopback robot, boxes on flat ground and a lidar."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.rotations import quaternion_from_yaw
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.server.factory import read_config
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.testing.loopback import LoopbackSession
from mbf_abstract.time.clock import Priority

ROBOT_RADIUS = 0.3
"""Radius of the robot [m]."""
SENSOR = "lidar"
"""Source of all scans, and the frame of the sensor."""
SENSOR_HEIGHT, SENSOR_RANGE, RAYS = 0.4, 5.0, 90
"""The sensor's height above ground [m], how far it sees [m], and its rays around."""
MAX_SILENCE = 1.0
"""A backend must not let the robot drive on a map whose sensor is silent for longer than this [s]."""
START = Pose.planar(2.0, 4.0)
"""Where the robot stands first; it looks along +x."""
T_map_dock = Transform((3.0, 5.0, 0.0), quaternion_from_yaw(math.pi / 2.0), "map", "dock", static=True)
"""A frame beside the map's, for poses of clients in another frame than the map's."""

TICK, TICKS_PER_SCAN = 0.1, 2  # s; every tick the robot's track is noted


@dataclass(frozen=True)
class Box:
    """An obstacle with upright walls, as high as everything: from (x0, y0) to (x1, y1) [m]."""

    x0: float
    y0: float
    x1: float
    y1: float

    def gap(self, x: float, y: float) -> float:
        """Distance [m] of a point; 0 inside."""
        return math.hypot(max(self.x0 - x, 0.0, x - self.x1), max(self.y0 - y, 0.0, y - self.y1))


class BackendRig(LoopbackSession):
    """The session of one situation and its world; its frames are ``map -> odom -> base_link -> lidar, map -> dock``.

    Attributes
    ----------
    folder : path
        An empty folder, for files of maps.
    boxes : list of Box
        What stands on the ground; the sensor sees it, no map knows of it.
    sensing : bool
        Clear it and the sensor falls silent.
    track : list of (time, x, y)
        Where the robot was, every 0.1 s.
    sensor_errors : list of str
        What ``take_scan`` raised.
    """

    def __init__(self, folder: FilePath) -> None:
        super().__init__(START, period=0.05)
        self.transforms.set(T_map_dock)
        self.transforms.set(Transform((0.0, 0.0, SENSOR_HEIGHT), parent="base_link", child=SENSOR, static=True))
        self.folder = folder
        self.boxes: list[Box] = []
        self.sensing = True
        self.track: list[tuple[float, float, float]] = []
        self.sensor_errors: list[str] = []
        self._over = False
        self.on_close(self._stop_sensor)

    def server(self, config: str, parameters: Mapping[str, Any]) -> MapServer:
        """Make the server of a configuration's text, with parameters that the text does not set.

        Raises
        ------
        ConfigError
            With all findings.
        ServerError
            A plugin's constructor failed.
        """
        file = self.folder / "navigation.yaml"
        lines = (f"{name}: {json.dumps(value)}" for name, value in parameters.items())  # JSON is legal YAML
        file.write_text("\n".join([config, *lines]), "utf-8")
        server_class, checked = read_config(file)
        return cast(MapServer, self.serve(server_class, checked, self.robot, self.transforms))

    def start_sensor(self, server: MapServer) -> None:
        """Scan from now on."""
        self.clock.spawn(lambda: self._loop(server), "conformance sensor", Priority.SIMULATOR)

    def scan(self) -> RangeScan:
        """What the sensor sees now, in its own frame."""
        pose = self.robot.pose
        angles = np.linspace(-math.pi, math.pi, RAYS, endpoint=False)
        world = np.column_stack([np.cos(angles + pose.yaw), np.sin(angles + pose.yaw)])
        ranges = np.minimum.reduce(
            [_ranges(box, pose.x, pose.y, world) for box in self.boxes] or [np.full(RAYS, np.inf)]
        )
        hits = ranges < SENSOR_RANGE
        reach = np.where(hits, ranges + 1e-3, SENSOR_RANGE)  # a hit lies inside the box, not on its side
        ends = np.column_stack([np.cos(angles) * reach, np.sin(angles) * reach, np.zeros(RAYS)])
        return RangeScan(SENSOR, SENSOR, np.zeros(3), ends, hits, self.clock.now())

    def least_gap(self) -> float:
        """Least distance [m] between the robot's centre and a box on the whole track."""
        return min((box.gap(x, y) for box in self.boxes for _, x, y in self.track), default=math.inf)

    def _stop_sensor(self) -> None:
        self._over = True

    def _loop(self, server: MapServer) -> None:
        start, ticks = self.clock.now(), 0
        while not self._over:
            pose = self.robot.pose
            self.track.append((self.clock.now(), pose.x, pose.y))
            if self.sensing and ticks % TICKS_PER_SCAN == 0:
                try:
                    server.take_scan(self.scan())
                except Exception as error:
                    self.sensor_errors.append(f"{type(error).__name__}: {error}")
            ticks += 1
            self.clock.sleep_until(start + ticks * TICK)


class MakeServer(Protocol):
    """What the author of a backend writes.

    The server of ``rig`` on flat, empty, known ground of 12 m x 8 m for a robot of 0.3 m radius, with ``parameters`` at
    the top level of its configuration. It takes scans of the source ``lidar`` and has at least one planner, one
    controller, and the recoveries ``wait``, ``rotate``, ``back_up``, ``clear``, ``relax`` and ``move_away`` under these
    names; where the map has refiners, all of them.
    """

    def __call__(self, rig: BackendRig, **parameters: Any) -> MapServer:
        """Make the server."""


def _ranges(box: Box, x: float, y: float, directions: FloatArray) -> NDArray[np.float64]:
    """Distances [m] at which rays (n, 2) from a point enter a box; inf where they pass it, or begin inside."""
    with np.errstate(divide="ignore"):
        to_low = (np.array([box.x0, box.y0]) - (x, y)) / directions
        to_high = (np.array([box.x1, box.y1]) - (x, y)) / directions
    enters, leaves = np.minimum(to_low, to_high).max(axis=1), np.maximum(to_low, to_high).min(axis=1)
    return np.where((enters <= leaves) & (enters > 0.0), enters, np.inf)
