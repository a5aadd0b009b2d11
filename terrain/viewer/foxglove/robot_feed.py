"""Parts of what a robot does that no recorder follows: a real one, or one of another simulator."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import FloatArray, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.tracking.robot_box import RobotBox
from mbf_abstract.maps.view import GridView, MeshView
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import unix_seconds
from terrain.recording.recorded_maps import RecordedGrid, RecordedMesh, add_if_changed
from terrain.recording.recorded_robot import Report, RobotShape, as_mount
from terrain.recording.recorder import LOCAL_MAP_PERIOD, MAP_PERIOD, MAX_GRID_CELLS, Recorder
from terrain.recording.recording import Recording
from terrain.viewer.foxglove.feeds import EventQueue

BODY_HEIGHT = 0.3  # m, of a robot of which only the outline is known
DISC = 0.25  # m, radius of one of which not even that is known
MAX_PLANS = 100  # that wait for the next part
MAX_VERTICES = 50_000  # of a mesh; the messages of larger ones would make the controller of the robot wait


@runtime_checkable
class DatedClock(Protocol):
    """A clock that knows the calendar: ``epoch`` [s since 1970] is when it shows 0."""

    epoch: float


class RobotFeed:
    """Looks at a robot; times are those of the calendar, so that they compare with those of other logs.

    Parameters
    ----------
    session : NavigationSession
        Its server is there.
    name : str
        Of the robot.

    Attributes
    ----------
    began : float
        Time [s] of the first look.
    is_watched : callable
        Whether anybody is there; while nobody is, scans and maps, which cost much, are left out.
    """

    def __init__(self, session: NavigationSession, name: str) -> None:
        self._session, self._server, self._name = session, session.navigator.server, name
        self._first_epoch = unix_seconds() - session.clock.now()
        self.began = session.clock.now() + self._epoch
        self.is_watched: Callable[[], bool] = lambda: True
        self._shape = RobotShape(name, _outline(self._server), BODY_HEIGHT, np.zeros((0, 3)), 0.0)
        self._events = EventQueue()
        self._scans: dict[str, RangeScan] = {}  # the newest of each sensor
        self._plans: deque[tuple[float, FloatArray]] = deque(maxlen=MAX_PLANS)
        self._next_map = self._next_local_map = 0.0
        self._grid = 0  # the last one, as a hash
        self._meshes: list[RecordedMesh] = []  # the first and the last
        session.events.add_sink(self._events)
        self._server.scan_listeners.append(self._take_scan)
        self._server.get_path.listeners.append(self._take_plan)
        self._server.refine_path.listeners.append(self._take_refined_plan)

    def close(self) -> None:
        """Look no more."""
        self._session.events.remove_sink(self._events)
        self._server.scan_listeners.remove(self._take_scan)
        self._server.get_path.listeners.remove(self._take_plan)
        self._server.refine_path.listeners.remove(self._take_refined_plan)

    def part(self) -> Recording | None:
        """Return what has come since the last part; None, and it is kept, while the robot's pose is not known."""
        runtime, now = self._server.runtime, self._session.clock.now()
        try:
            pose = runtime.robot.pose()
        except RobotStateError:
            return None
        velocity = self._velocity()
        grids, meshes = self._changed_maps(now)  # first: where it raises, what has come waits for the next part
        recorder = Recorder(self._name, self._server.config.backend, self._shape, pose, [])
        self._look_around(recorder, now)  # likewise
        report = Report(pose, None, velocity)
        recorder.sample(now + self._epoch, pose, velocity or Twist(), runtime.gate.last_command, report)
        while self._plans:
            recorder.path(*self._plans.popleft())
        self._place_scans(recorder)
        part = replace(recorder.finish(events=self._events.take(), began=-self._epoch), grids=grids, meshes=meshes)
        return part if velocity is not None else replace(part, twists=np.full_like(part.twists, np.nan))

    @property
    def _epoch(self) -> float:
        """Time [s since 1970] at which the session's clock shows 0; that of ROS time may jump."""
        clock = self._session.clock
        return clock.epoch if isinstance(clock, DatedClock) else self._first_epoch

    def _velocity(self) -> Twist | None:
        try:
            return self._server.runtime.robot.measured_velocity()
        except RobotStateError:
            return None

    def _place_scans(self, recorder: Recorder) -> None:
        scans, self._scans = self._scans, {}
        if not self.is_watched():
            return
        robot, transforms = self._server.runtime.robot, self._server.runtime.transforms
        for scan in scans.values():
            try:
                placed = scan.in_frame(robot.global_frame, transforms)
                time, points, origin = scan.stamp + self._epoch, placed.points, placed.origin
                if scan.frame_id in (robot.global_frame, robot.robot_frame) or scan.origin.any():
                    recorder.scan(time, points, origin)  # it is not in the frame of a sensor
                    continue
                T_base_sensor = transforms.lookup(robot.robot_frame, scan.frame_id)
                T_map_sensor = scan.transform_to(robot.global_frame, transforms)
            except TransformError:
                continue  # it is older than what is known of the robot
            recorder.reports.mounts[scan.frame_id] = as_mount(T_base_sensor)
            recorder.scan(time, points, origin, scan.frame_id, T_map_sensor.rotation)

    def _look_around(self, recorder: Recorder, now: float) -> None:
        """Record the map around the robot, and its outline, if that was done some time ago."""
        server = self._server
        if now < self._next_local_map or not self.is_watched() or not isinstance(server, MapServer):
            return
        self._next_local_map = now + LOCAL_MAP_PERIOD
        near = server.local_map.map
        recorder.reports.outline(now + self._epoch, near.robot_outline)
        if server.local_view:
            recorder.reports.local_map(now + self._epoch, near.frame_id, server.map_view(server.local_view))

    def _changed_maps(self, now: float) -> tuple[list[RecordedGrid], list[RecordedMesh]]:
        """The map, if it has changed since it was looked at some seconds ago."""
        if now < self._next_map or not self.is_watched():
            return [], []
        self._next_map = now + MAP_PERIOD
        view, time = self._server.map_view(), now + self._epoch
        if isinstance(view, GridView) and view.costs.size <= MAX_GRID_CELLS:
            before, self._grid = self._grid, hash((view.extent, view.costs.tobytes()))
            return ([RecordedGrid.of(time, view)] if self._grid != before else []), []
        if isinstance(view, MeshView) and view.costs.size <= MAX_VERTICES:
            known = len(self._meshes)
            add_if_changed(self._meshes, time, view)
            new = self._meshes[known:]
            del self._meshes[1:-1]
            return [], new
        return [], []

    # ------------------------------------------------------------------------------- on other threads
    def _take_scan(self, scan: RangeScan) -> None:
        self._scans[scan.source] = scan

    def _take_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.path if handle.result is not None else None
        if path is not None:
            self._plans.append((self._session.clock.now() + self._epoch, path.positions))

    def _take_refined_plan(self, handle: AnyGoalHandle) -> None:
        path = handle.result.refined_path if handle.result is not None else None
        if path is not None:
            self._plans.append((self._session.clock.now() + self._epoch, path.positions))


def _outline(server: object) -> FloatArray:
    """Corners (n, 2) [m] of the robot."""
    outline = server.global_map.map.robot_box.outline() if isinstance(server, MapServer) else None
    return RobotBox.disc(DISC).outline() if outline is None or not np.ptp(outline) else outline
