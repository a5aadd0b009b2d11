"""A replay of a run for any browser: one HTML file that can be opened without network and without Python.

The scene is built once in a viser server that listens at loopback only; its messages, with the times between them, are
the recording, which viser packs into one page with its own viewer, a time bar and speeds. Files stay small because a
frame is only the robot's pose: about 3 MB for a terrain of a quarter of a million triangles.

Use ``terrain.viewer.pictures.picture`` where one look is enough.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.recording.recording import Recording
from terrain.viewer.replay_panel import legend_of, with_panel
from terrain.viewer.scene import (
    ActorModels,
    RobotModel,
    add_path,
    add_scan,
    add_track_piece,
    add_world,
    look_at_route,
    pin_height,
    wheel_angles,
)
from terrain.viewer.server.page_server import page_server

FRAME_RATE = 10.0  # Hz of recorded time
MAX_FRAMES = 3000  # longer runs get fewer frames a second, so that the file stays small
TRACK_PIECES = 200
MAX_SCANS = 300
MAX_SCAN_POINTS = 180
FIRST_PORT = 18080  # viser takes the next free one
OUTCOME_TIME = 3.0  # s for which the outcome is shown at the end


def replay_html(recording: Recording) -> str:
    """Return a recording as one HTML page; raises ViewerMissing where viser is not installed or cannot run."""
    with page_server(FIRST_PORT) as server:
        look_at_route(server.initial_camera, recording)
        add_world(server.scene, recording)
        robot = RobotModel(server.scene, recording.robot, pin_height(recording))
        actors = ActorModels(server.scene, recording.actors)
        serializer = server.get_scene_serializer()
        if len(recording.times):
            _Player(server, serializer, recording, robot, actors).play()
        page: str = serializer.as_html()
    return with_panel(page, recording.verdict, recording.events, legend_of(recording))


class _Player:
    """Plays a recording into a serializer, frame by frame."""

    def __init__(
        self, server: Any, serializer: Any, recording: Recording, robot: RobotModel, actors: ActorModels
    ) -> None:
        self._scene = server.scene
        self._serializer = serializer
        self._recording = recording
        self._robot = robot
        self._actors = actors
        self._frames = frame_indices(recording.times)
        self._scans = _thinned(recording.scans, MAX_SCANS)
        self._next_path = 0
        self._next_scan = 0
        self._track_from = 0

    def play(self) -> None:
        recording, frames = self._recording, self._frames
        angles = wheel_angles(recording.robot, recording.times, recording.twists)
        piece = max(1, len(frames) // TRACK_PIECES)
        for number, (index, following) in enumerate(zip(frames, [*frames[1:], frames[-1]], strict=True)):
            now = float(recording.times[index])
            self._robot.place(recording.poses[index], angles[index], status_text(recording, int(index)))
            self._actors.place(track.poses[index] for track in recording.actors)
            self._show_new_plans(now)
            self._show_newest_scan(now)
            if number % piece == 0 or index == frames[-1]:
                self._extend_track(int(index))
            self._serializer.insert_sleep(float(recording.times[following]) - now)
        self._show_outcome()

    def _show_new_plans(self, now: float) -> None:
        paths = self._recording.paths
        while self._next_path < len(paths) and paths[self._next_path][0] <= now:
            add_path(self._scene, "/plan", paths[self._next_path][1])
            self._next_path += 1

    def _show_newest_scan(self, now: float) -> None:
        newest = None
        while self._next_scan < len(self._scans) and self._scans[self._next_scan][0] <= now:
            newest = self._scans[self._next_scan][1]
            self._next_scan += 1
        if newest is not None and len(newest):
            add_scan(self._scene, "/scan", newest[:: max(1, len(newest) // MAX_SCAN_POINTS)])

    def _extend_track(self, index: int) -> None:
        points = self._recording.poses[self._track_from : index + 1, :3]
        if len(points) > 1:
            add_track_piece(self._scene, f"/track/{self._track_from}", points[_corners(points)])
            self._track_from = index

    def _show_outcome(self) -> None:
        recording = self._recording
        text = str(recording.verdict)
        self._robot.place(recording.poses[-1], np.zeros(len(recording.robot.wheels)), text)
        self._serializer.insert_sleep(OUTCOME_TIME)


def frame_indices(times: FloatArray) -> NDArray[np.intp]:
    """Indices of the samples to show: at ``FRAME_RATE``, at most ``MAX_FRAMES``, first and last always."""
    duration = float(times[-1] - times[0])
    period = max(1.0 / FRAME_RATE, duration / MAX_FRAMES)
    wanted = times[0] + period * np.arange(int(duration / period) + 1)
    found = np.minimum(np.searchsorted(times, wanted - 1e-9), len(times) - 1)
    return np.unique(np.concatenate([found, [len(times) - 1]]))


def status_text(recording: Recording, index: int) -> str:
    """Text above the robot."""
    speed = float(np.hypot(*recording.twists[index, :2]))
    tilt = float(np.degrees(recording.tilt[index]))
    return f"{recording.times[index]:.0f} s   {speed:.1f} m/s   tilt {tilt:.0f}°"


def _thinned(items: list[tuple[float, FloatArray]], limit: int) -> list[tuple[float, FloatArray]]:
    return items[:: -(-len(items) // limit)] if items else []


def _corners(points: FloatArray) -> NDArray[np.bool_]:
    """Which points of a track to keep: the ends, and those more than 0.1 m from the last one kept."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    last = points[0]
    for index, point in enumerate(points):
        if np.linalg.norm(point - last) > 0.1:
            keep[index], last = True, point
    return keep
