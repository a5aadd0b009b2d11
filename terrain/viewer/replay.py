"""A replay of a run for any browser: one HTML file that can be opened without network and without Python.

The scene is built once in a viser server that listens at loopback only; its messages, with the times between them, are
the recording, which viser packs into one page with its own viewer, a time bar and speeds. Files stay small because a
frame is only the robot's pose: about 3 MB for a terrain of a quarter of a million triangles.

Use ``terrain.viewer.pictures.picture`` where one look is enough.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.recording.joint_recording import JointRecording
from terrain.recording.recording import Recording
from terrain.viewer.pictures.colours import BODY, DRIVEN, FLEET, Colour
from terrain.viewer.replay_panel import legend_of, with_panel
from terrain.viewer.scene import (
    ActorModels,
    RobotModel,
    add_ground,
    add_marks,
    add_path,
    add_scan,
    add_solids,
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
        player = _Player(server.scene, recording, pin_height(recording), PLAIN)
        page = _played(server, recording, [player], recording.times)
    return with_panel(page, recording.verdict, recording.events, legend_of(recording))


def joint_replay_html(run: JointRecording) -> str:
    """Return the recordings of several robots as one HTML page; as ``replay_html``."""
    world, height = run.world, pin_height(run.world)
    looks = [Looks(name, FLEET[number % len(FLEET)]) for number, name in enumerate(run.robots)]
    with page_server(FIRST_PORT) as server:
        look_at_route(server.initial_camera, world)
        if world.ground is not None:
            add_ground(server.scene, world.ground)
        add_solids(server.scene, world)
        players = []
        for look, recording in zip(looks, run.robots.values(), strict=True):
            add_marks(server.scene, recording, height, look.name)
            players.append(_Player(server.scene, recording, height, look))
        times = min((recording.times for recording in run.robots.values()), key=len)
        page = _played(server, world, players, times)
    return with_panel(page, world.verdict, world.events, [*legend_of(world)[:1], *looks])


class Looks(NamedTuple):
    """Name and colour of a robot among several; a robot that is alone has no name."""

    name: str
    colour: Colour


PLAIN = Looks("", DRIVEN)


def _played(server: Any, world: Recording, players: list[_Player], times: FloatArray) -> str:
    """Play recordings that were sampled at the same times (n,) [s] into a page."""
    actors = ActorModels(server.scene, world.actors)
    serializer = server.get_scene_serializer()
    frames = frame_indices(times) if len(times) else np.zeros(0, np.intp)
    piece = max(1, len(frames) // TRACK_PIECES)
    for number, (index, following) in enumerate(zip(frames, [*frames[1:], *frames[-1:]], strict=True)):
        actors.place(track.poses[index] for track in world.actors)
        for player in players:
            player.show(int(index), extends_track=number % piece == 0 or index == frames[-1])
        serializer.insert_sleep(float(times[following] - times[index]))
    if len(times):
        for player in players:
            player.show_outcome()
        serializer.insert_sleep(OUTCOME_TIME)
    page: str = serializer.as_html()
    return page


class _Player:
    """Plays one robot's recording into a scene, frame by frame."""

    def __init__(self, scene: Any, recording: Recording, label_height: float, look: Looks) -> None:
        self._scene = scene
        self._recording = recording
        self._look = look
        self._node = f"/{look.name}" if look.name else ""
        body = look.colour if look.name else BODY
        self._robot = RobotModel(scene, recording.robot, label_height, f"{self._node}/robot", body)
        self._angles = wheel_angles(recording.robot, recording.times, recording.twists)
        self._scans = _thinned(recording.scans, MAX_SCANS)
        self._next_path = 0
        self._next_scan = 0
        self._track_from = 0

    def show(self, index: int, extends_track: bool) -> None:
        """Show the sample of this index."""
        recording = self._recording
        now, text = float(recording.times[index]), f"{self._look.name}  {status_text(recording, index)}".lstrip()
        self._robot.place(recording.poses[index], self._angles[index], text)
        self._show_new_plans(now)
        self._show_newest_scan(now)
        if extends_track:
            self._extend_track(index)

    def _show_new_plans(self, now: float) -> None:
        paths = self._recording.paths
        while self._next_path < len(paths) and paths[self._next_path][0] <= now:
            add_path(self._scene, f"{self._node}/plan", paths[self._next_path][1])
            self._next_path += 1

    def _show_newest_scan(self, now: float) -> None:
        newest = None
        while self._next_scan < len(self._scans) and self._scans[self._next_scan][0] <= now:
            newest = self._scans[self._next_scan][1]
            self._next_scan += 1
        if newest is not None and len(newest):
            add_scan(self._scene, f"{self._node}/scan", newest[:: max(1, len(newest) // MAX_SCAN_POINTS)])

    def _extend_track(self, index: int) -> None:
        points = self._recording.poses[self._track_from : index + 1, :3]
        if len(points) > 1:
            add_track_piece(
                self._scene, f"{self._node}/track/{self._track_from}", points[_corners(points)], self._look.colour
            )
            self._track_from = index

    def show_outcome(self) -> None:
        """Show the last sample with the verdict."""
        recording = self._recording
        text = f"{self._look.name}  {recording.verdict}".lstrip()
        self._robot.place(recording.poses[-1], np.zeros(len(recording.robot.wheels)), text)


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
