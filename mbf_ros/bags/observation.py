"""What is kept of a replay: the robot's poses, scans, and the map at several times, as a ``DriveLog``."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mbf_abstract.drive_log import DriveLog, LoggedScan
from mbf_abstract.events import Event
from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import MapView
from mbf_abstract.server.map_server import MapServer
from mbf_ros.bags.inputs import RecordedRobot
from mbf_ros.bags.planning import ReplayedPlan

SCAN_PERIOD = 0.5  # s between two scans of a source that are kept, in bags of up to a quarter of an hour
MOST_SCANS, MOST_POINTS = 2000, 5000  # of a source, and of a scan, that are kept to be shown
MOST_COSTS = 200_000_000  # of all maps that are kept, four bytes each


class Observation:
    """Looks at a server while a bag is replayed into it.

    Parameters
    ----------
    map_name : str
        Which of ``server.map_views``; the first one if empty.
    began, duration : float
        Our time [s] at which the bag begins, from where what is kept counts, and its length [s].

    Raises
    ------
    ValueError
        There is no such map.
    """

    def __init__(self, server: MapServer, robot: RecordedRobot, map_name: str, began: float, duration: float) -> None:
        if map_name and map_name not in server.map_views:
            raise ValueError(f"--map: expected one of {', '.join(server.map_views)}, got {map_name!r}")
        self._server, self._robot, self._map_name, self._began = server, robot, map_name, began
        served = server.served.get(map_name) or server.global_map
        self.frame_id: str = served.map.frame_id
        self._transform_tolerance: float = served.transform_tolerance
        self.poses_unknown = 0
        self._outline = served.map.robot_box.outline()
        self._rows: list[list[float]] = []
        self._scans: list[LoggedScan] = []
        self._next_scan: dict[str, float] = {}
        self._scan_period = max(SCAN_PERIOD, duration / MOST_SCANS)
        self._maps: list[tuple[float, MapView]] = []

    def sample(self, now: float) -> None:
        """Note where the robot is and how fast it moves; nothing while its pose is unknown or old."""
        robot = self._server.runtime.robot
        limits = {"now": now, "max_age": robot.max_pose_age}
        try:
            place = self._server.runtime.transforms.lookup(self.frame_id, robot.robot_frame, **limits)
        except TransformError:
            self.poses_unknown += 1
            return
        velocity = [math.nan] * 3
        if self._robot.last is not None:
            measured = self._robot.last.velocity
            velocity = [measured.vx, measured.vy, measured.wz]
        self._rows.append([now - self._began, *place.translation, *place.rotation, *velocity])

    def take_scan(self, scan: RangeScan) -> None:
        """Keep what a scan hit, unless one of its source was kept just before."""
        if scan.stamp < self._next_scan.get(scan.source, -math.inf):
            return
        try:
            placed = scan.in_frame(self.frame_id, self._server.runtime.transforms, self._transform_tolerance)
        except TransformError:  # another map could place it
            return
        self._next_scan[scan.source] = scan.stamp + self._scan_period
        points = placed.points[:: 1 + len(placed.points) // MOST_POINTS]
        self._scans.append(LoggedScan(max(scan.stamp - self._began, 0.0), placed.origin, points))

    def check_pictures(self, count: int) -> None:
        """Raise ValueError where so many pictures of the map would not fit into the memory."""
        view = self._server.map_view(self._map_name)
        costs = 0 if view is None else view.costs.size
        if costs * count > MOST_COSTS:
            most = MOST_COSTS // costs
            raise ValueError(f"--every: expected at most {most} pictures of a map of {costs} costs, got {count}")

    def look_at_map(self, now: float) -> None:
        """Keep what the map looks like."""
        view = self._server.map_view(self._map_name)
        if view is not None:
            self._maps.append((now - self._began, view))

    def log(
        self, name: str, plan: ReplayedPlan | None, outcome: int | None, message: str, events: Sequence[Event]
    ) -> DriveLog:
        """Return what was kept, and the plan; ``events`` in the time of the bag."""
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, 11)
        first = rows[0, 1:8].tolist() if len(rows) else [0.0] * 6 + [1.0]
        return DriveLog(
            name=name,
            backend=self._server.config.backend,
            frame_id=self.frame_id,
            outline=self._outline,
            start=Pose(tuple(first[:3]), tuple(first[3:]), self.frame_id),
            goals=() if plan is None or plan.shown_goal is None else (plan.shown_goal,),
            times=rows[:, 0].copy(),
            poses=rows[:, 1:8].copy(),
            twists=rows[:, 8:11].copy(),
            commands=np.full((len(rows), 3), np.nan),
            paths=[]
            if plan is None or plan.shown_path is None
            else [(plan.time - self._began, plan.shown_path.positions)],
            scans=self._scans,
            maps=self._maps,
            events=tuple(events),
            outcome=outcome,
            message=message,
        )
