"""Where the frames of a run are over time, and the track that the robot leaves, from parts that follow each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from mbf_abstract.geometry import FloatArray
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recording import Recording
from terrain.viewer.logs import foxglove_messages as message
from terrain.viewer.logs import foxglove_scene as scene
from terrain.viewer.logs.robot_messages import reported_frames
from terrain.viewer.scene import wheel_angles

TRACK_PIECE = 5.0  # s
STANDING = 0.05  # m within which a robot that stands is shown by an unsteady localisation


class MovingFrames:
    """The frames of the robot, of its wheels, which roll, and of actors.

    Parameters
    ----------
    frame : str
        Of the map.
    """

    def __init__(self, shape: RobotShape, frame: str) -> None:
        self._shape, self._frame = shape, frame
        self._angles = np.zeros(len(shape.wheels))
        self._last: tuple[FloatArray, FloatArray] | None = None  # time and twist of the last sample

    def take(self, part: Recording) -> Iterator[tuple[float, Callable[[], FrameTransforms]]]:
        """Yield the time of each sample, and what makes its message."""
        angles = self._turn(part.times, part.twists)
        for sample, time in enumerate(part.times.tolist()):
            yield time, partial(self._message, part, sample, time, angles[sample].tolist())

    def _turn(self, times: FloatArray, twists: FloatArray) -> FloatArray:
        """Angles (n, k) of the wheels, which go on from those of the last part."""
        if not len(times):
            return np.zeros((0, len(self._angles)))
        before = (times[:0], twists[:0]) if self._last is None else self._last
        self._last = times[-1:], twists[-1:]
        rolled = wheel_angles(self._shape, np.concatenate([before[0], times]), np.concatenate([before[1], twists]))
        angles = self._angles + rolled[len(before[0]) :]
        self._angles = angles[-1]
        return angles

    def _message(self, part: Recording, sample: int, time: float, angles: list[float]) -> FrameTransforms:
        row = part.poses[sample]
        body = message.transform(time, self._frame, "base_link", row[:3], row[3:])
        wheels = [
            message.transform(time, "base_link", scene.wheel_frame(index), centre, _about_y(angle))
            for index, (centre, angle) in enumerate(zip(self._shape.wheels, angles, strict=True))
        ]
        actors = [
            message.transform(
                time, self._frame, scene.actor_frame(index), track.poses[sample, :3], track.poses[sample, 3:]
            )
            for index, track in enumerate(part.actors)
        ]
        reported = reported_frames(part.reports, self._frame, sample, time)
        return FrameTransforms(transforms=[body, *wheels, *actors, *reported])


class Track:
    """Cuts the driven track into pieces of ``TRACK_PIECE`` seconds; each has its number, end [s] and points.

    While the robot stands there are none.
    """

    def __init__(self) -> None:
        self._number = 0
        self._due = math.inf
        self._times: list[float] = []  # from the last sample of the piece before on
        self._points: list[list[float]] = []

    def take(self, times: FloatArray, poses: FloatArray) -> Iterator[tuple[int, float, FloatArray]]:
        """Yield the pieces that end with one of these samples."""
        for time, point in zip(times.tolist(), poses[:, :3].tolist(), strict=True):
            is_set_back = bool(self._times) and time < self._times[-1]
            self._times.append(time)
            self._points.append(point)
            if len(self._times) == 1:
                self._due = time + TRACK_PIECE
            elif time >= self._due or is_set_back:
                yield from self.end()
                self._due = time + TRACK_PIECE

    def end(self) -> Iterator[tuple[int, float, FloatArray]]:
        """Yield what has been driven since the last piece, if anything."""
        if not self._times:
            return
        points = np.array(self._points)
        if np.ptp(points, axis=0).max() >= STANDING:
            yield self._number, self._times[-1], points
            self._points = self._points[-1:]
            self._number += 1
        self._times, self._points = self._times[-1:], self._points[:1]


def _about_y(angle: float) -> FloatArray:
    return np.array([0.0, math.sin(angle / 2.0), 0.0, math.cos(angle / 2.0)])
