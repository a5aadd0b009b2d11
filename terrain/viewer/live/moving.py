"""What moves or changes in the live view: robot, actors, plan, predicted motion, scans."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from mbf_abstract.geometry import Command, FloatArray, Path, Pose, Twist
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.maps.view import FieldView
from mbf_abstract.plugins import PlannedMotion, PluginKind
from terrain.recording.recorded_objects import NUMBER, RADIUS, RecordedObjects, X, Z
from terrain.session.session import Session
from terrain.viewer.live.overlay import Overlay
from terrain.viewer.pictures.colours import GOAL, PLANNED, TRACKED
from terrain.viewer.replay.scene_content import velocity_arrows
from terrain.viewer.scene import (
    LINE_LIFT,
    LINE_WIDTH,
    ActorModels,
    RobotModel,
    add_path,
    add_pin,
    add_scan,
    add_track_piece,
    wheel_angles,
)

ABOVE_PINS = 2.0  # height of the robot's label by that of markers, so that it is not on that of the start
AHEAD = 2.0  # s over which the present command is extrapolated
AHEAD_STEPS = 20
FIELD_ARROWS = 40  # along the longer side of the field
FIELD_COLOUR = (120, 150, 215)
AHEAD_COLOUR = (245, 60, 190)
TRACK_PERIOD = 10  # samples of the recorder between two looks at the track
MAX_TRACK = 2000  # points of the track that are drawn
TRAIL = 50  # places of a tracked object that are drawn: those of five seconds
CORNERS = 16  # of the circle around one


class MovingThings:
    """Robot, actors, tracked objects, goal, plan, vector field, local plan, scans and track.

    Parameters
    ----------
    pin_height : float
        Height [m] of markers.
    """

    def __init__(self, server_page: Any, session: Session, pin_height: float) -> None:
        self._scene = server_page.scene
        self._session = session
        self._pin_height = pin_height
        self._shape = session.recorder.robot
        self._robot = RobotModel(self._scene, self._shape, ABOVE_PINS * pin_height)
        self._actors = ActorModels(self._scene, session.recorder.actor_tracks())
        self._angles = np.zeros(len(self._shape.wheels))
        self._time = 0.0
        self._path: Path | None = None  # the newest, refined or not
        self._planned: Path | None = None  # the one that the planner made, with what it knows of its field
        self._goal: Pose | None = None  # one that is not marked yet
        gui = server_page.gui
        self._plan = Overlay(gui, "plan")
        self._track = Overlay(gui, "driven track")
        self._ahead = Overlay(gui, "local plan")
        self._field = Overlay(gui, "vector field")
        self._scan = Overlay(gui, "lidar")
        self._tracked = Overlay(gui, "tracked objects")
        self._trails: dict[int, deque[FloatArray]] = {}
        session.navigator.server.get_path.listeners.append(self._take_plan)
        session.navigator.server.refine_path.listeners.append(self._take_refined_plan)

    def show_goal(self, goal: Pose) -> None:
        """Mark a goal that is none of the scenario's."""
        self._goal = goal

    def show(self, time: float, text: str, is_driving: bool) -> None:
        """Draw the present state with ``text`` above the robot; a plan only while there is a goal."""
        self._show_robot(time, text)
        self._actors.place(as_row(actor.pose()) for actor in self._session.recorder.actors)
        self._show_plan(self._path if is_driving else None)
        self._show_scans()
        self._show_tracked(time)
        track = self._session.simulation.track
        self._track.update(len(track) // TRACK_PERIOD, lambda: self._draw_track(track))
        if self._goal is not None:
            add_pin(self._scene, "/goal_asked_for", self._goal, GOAL, "new goal", self._pin_height)
            self._goal = None

    def _show_robot(self, time: float, text: str) -> None:
        robot = self._session.simulation.robot
        pose, velocity = robot.pose(), robot.velocity()
        times = np.array([self._time, time])
        twists = np.tile([velocity.vx, velocity.vy, velocity.wz], (2, 1))
        self._angles = self._angles + wheel_angles(self._shape, times, twists)[-1]
        self._time = time
        self._robot.place(as_row(pose), self._angles, text)
        motion = self._next_motion()
        if motion is None:
            self._ahead.clear()
        else:
            self._ahead.update(
                time, lambda: add_path(self._scene, "/ahead", predicted_points(pose, motion), AHEAD_COLOUR)
            )

    def _next_motion(self) -> PlannedMotion | None:
        """What the controller at work has planned, or else its present command, for a while."""
        server = self._session.navigator.server
        driving = server.exe_path.unfinished
        if driving:
            names = server.plugins.names(PluginKind.CONTROLLER)
            controller = server.plugins.find(PluginKind.CONTROLLER, driving[0].goal.controller or names[0])
            motion: PlannedMotion | None = None if controller is None else controller.instance.planned_motion()
            if motion is not None:
                return motion
        return motion_of(server.runtime.gate.last_command)

    def _take_plan(self, handle: AnyGoalHandle) -> None:
        path = None if handle.result is None else handle.result.path
        if path is not None:
            self._path = self._planned = path

    def _take_refined_plan(self, handle: AnyGoalHandle) -> None:
        path = None if handle.result is None else handle.result.refined_path
        if path is not None:
            self._path = path

    def _show_plan(self, path: Path | None) -> None:
        if path is None:
            self._plan.clear()
            self._field.clear()
            return
        self._plan.update(id(path), lambda: add_path(self._scene, "/plan", path.positions, PLANNED))
        if (planned := self._planned) is not None:
            self._field.update(id(planned), lambda: self._draw_field(planned))

    def _draw_field(self, path: Path) -> Any:
        field = self._session.navigator.server.field_view(path)
        if field is None:
            return None
        segments, spacing = field_arrows(field)
        return self._scene.add_arrows(
            "/field", segments, FIELD_COLOUR, shaft_radius=0.03 * spacing, head_radius=0.1 * spacing,
            head_length=0.25 * spacing,
        )  # fmt: skip

    def _draw_track(self, track: list[Pose]) -> Any:
        every = max(1, len(track) // MAX_TRACK)
        points = np.array([pose.position for pose in track[::every]])
        return add_track_piece(self._scene, "/track", points)

    def _show_scans(self) -> None:
        scans = [scan for scan in self._session.simulation.latest.values() if isinstance(scan, RangeScan)]
        if scans:
            points = np.concatenate([scan.points for scan in scans])
            stamps = tuple(scan.stamp for scan in scans)
            self._scan.update(stamps, lambda: add_scan(self._scene, "/scan", points))

    def _show_tracked(self, time: float) -> None:
        rows = RecordedObjects.of(time, self._session.tracked_objects()).rows
        known = rows[:, NUMBER].astype(int).tolist()
        self._trails = {number: self._trails.get(number, deque(maxlen=TRAIL)) for number in known}
        for trail, row in zip(self._trails.values(), rows, strict=True):
            trail.append(row[X : Z + 1] + np.array([0.0, 0.0, LINE_LIFT]))
        self._tracked.update(rows.tobytes(), lambda: self._draw_tracked(rows))

    def _draw_tracked(self, rows: FloatArray) -> Any:
        segments = tracked_segments(rows, [np.array(trail) for trail in self._trails.values()])
        if not len(segments):
            return None
        return self._scene.add_line_segments(
            "/tracked", segments.astype(np.float32), TRACKED, thickness=LINE_WIDTH, thickness_units="screen"
        )  # fmt: skip


def tracked_segments(rows: FloatArray, trails: Sequence[FloatArray]) -> FloatArray:
    """Line segments (n, 2, 3) [m] of tracked objects: an arrow for the velocity, a circle, and where each was before.

    Parameters
    ----------
    rows : (k, COLUMNS) float64
        Those of ``RecordedObjects``.
    trails : sequence of (m, 3) float64
        Places [m], oldest first.
    """
    angles = 2.0 * np.pi * np.arange(CORNERS + 1) / CORNERS
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    lines = [row[X : Z + 1] + (0.0, 0.0, LINE_LIFT) + row[RADIUS] * ring for row in rows]
    joined = [np.stack([line[:-1], line[1:]], axis=1) for line in (*lines, *trails)]
    return np.concatenate([velocity_arrows(rows).reshape(-1, 2, 3), *joined])


def as_row(pose: Pose) -> FloatArray:
    """Pose as (7,) x y z qx qy qz qw."""
    return np.array([*pose.position, *pose.orientation])


def motion_of(command: Command) -> PlannedMotion | None:
    """Return a command held for ``AHEAD`` s; None for one that moves nothing, or to a car, whose arc depends on it."""
    if not isinstance(command, Twist) or command.is_stopped():
        return None
    return PlannedMotion(np.tile([command.vx, command.vy, command.wz], (AHEAD_STEPS, 1)), AHEAD / AHEAD_STEPS)


def predicted_points(pose: Pose, motion: PlannedMotion) -> FloatArray:
    """Points (n + 1, 3) [m] that a motion leads through, in the plane the robot stands on."""
    vx, vy, wz = motion.velocities.T * motion.step_time
    heading = np.cumsum(wz) - 0.5 * wz  # in the middle of each step
    x = np.cumsum(vx * np.cos(heading) - vy * np.sin(heading))
    y = np.cumsum(vx * np.sin(heading) + vy * np.cos(heading))
    in_base = np.zeros((len(x) + 1, 3))
    in_base[1:, :2] = np.stack([x, y], axis=1)
    return np.asarray(in_base @ pose.rotation.T + pose.position)


def field_arrows(field: FieldView) -> tuple[FloatArray, float]:
    """Arrows (k, 2, 3) [m] of a field, one for each square of a raster over it, and the side of a square [m]."""
    low, high = field.points[:, :2].min(axis=0), field.points[:, :2].max(axis=0)
    spacing = max(float((high - low).max()) / FIELD_ARROWS, 1e-3)
    squares = np.floor((field.points - np.array([*low, 0.0])) / spacing).astype(int)
    _, first = np.unique(squares, axis=0, return_index=True)
    starts = field.points[first] + np.array([0.0, 0.0, LINE_LIFT])
    return np.stack([starts, starts + 0.7 * spacing * field.directions[first]], axis=1), spacing
