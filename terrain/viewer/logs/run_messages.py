"""A run as a stream of messages by topic, in Foxglove's schemas where there is one and as JSON where not.

=============== ======================== =====================================================
topic           schema                   contents
=============== ======================== =====================================================
/tf             foxglove.FrameTransforms true pose of ``base_link``, of its wheels and sensors, of actors; estimates
/scene          foxglove.SceneUpdate     ground, walls, obstacles, marks, robot, actors, track
/plan           foxglove.PosesInFrame    every plan the robot followed
/goals          foxglove.PosesInFrame    the goals, in order
/scan           foxglove.PointCloud      what a range sensor hit, in its frame
/map            foxglove.Grid            the map, where it is a grid
/mesh_map       foxglove.SceneUpdate     the map, where it is a mesh, in the colours of its costs
/log            foxglove.Log             events as text
/events         mbf.Event                events as in events.jsonl
/actions        mbf.ActionStates         what each action does
/motion         mbf.Motion               speed, yaw rate, their commands, tilt, cross-track error
/local_map      foxglove.Grid            the map around the robot, where there is one
/footprint      foxglove.SceneUpdate     outline with which the navigation plans
/estimated_pose foxglove.PoseInFrame     where the localisation has the robot
/odom           mbf.Odometry             odometry as in nav_msgs/Odometry
/objects        foxglove.SceneUpdate     what the robot knows of things that move, with velocities
=============== ======================== =====================================================

``RunMessages`` makes them of a recording, whole (run.mcap) or part by part while the run goes on (live).
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from mbf_abstract.events import Event
from terrain.recording.metrics import cross_track_errors
from terrain.recording.recording import Recording, StampedPoints
from terrain.viewer.logs import foxglove_messages as message
from terrain.viewer.logs import foxglove_scene as scene
from terrain.viewer.logs.event_messages import ActionStates, JsonMessage, Stamped, event_message, log_message
from terrain.viewer.logs.foxglove_mesh_costs import MeshCosts
from terrain.viewer.logs.moving_frames import MovingFrames, Track
from terrain.viewer.logs.robot_messages import RobotMessages, scan_messages
from terrain.viewer.reports.timeline import ACTIONS

MAX_PIECES = 2000  # of the track, some three hours of driving; then the oldest are replaced
NUMBER, TEXT = {"type": "number"}, {"type": "string"}
MOTION = ("speed", "commanded_speed", "yaw_rate", "commanded_yaw_rate", "tilt_deg", "cross_track_error")
JSON_FIELDS: dict[str, dict[str, Any]] = {
    "mbf.Event": {"time": NUMBER, "kind": TEXT, "source": TEXT, "data": {"type": "object"}},
    "mbf.ActionStates": dict.fromkeys(ACTIONS, TEXT),
    "mbf.Motion": dict.fromkeys(MOTION, NUMBER),
    "mbf.Odometry": {"frame_id": TEXT, "child_frame_id": TEXT, "pose": {"type": "object"}, "twist": {"type": "object"}},
}
TOPICS: dict[str, Any] = {
    "/tf": FrameTransforms,
    "/scene": SceneUpdate,
    "/plan": PosesInFrame,
    "/scan": PointCloud,
    "/map": Grid,
    "/mesh_map": SceneUpdate,
    "/objects": SceneUpdate,
    "/goals": PosesInFrame,
    "/local_map": Grid,
    "/footprint": SceneUpdate,
    "/estimated_pose": PoseInFrame,
    "/odom": "mbf.Odometry",
    "/log": Log,
    "/events": "mbf.Event",
    "/actions": "mbf.ActionStates",
    "/motion": "mbf.Motion",
}
"""Of each topic the class of its protobuf messages, or the name of its JSON schema."""


def json_schema(name: str) -> str:
    """Return the text of a schema of our own: every field it may have."""
    return json.dumps({"title": name, "type": "object", "properties": JSON_FIELDS[name]})


def bytes_of(made: Any) -> bytes:
    """Return a protobuf message or a ``JsonMessage`` as it is written."""
    if isinstance(made, JsonMessage):
        return json.dumps(made.values, sort_keys=True, allow_nan=False).encode()
    return bytes(made.SerializeToString(deterministic=True))


def messages_of(recording: Recording) -> list[Stamped]:
    """All messages of a run, in the order of time."""
    maker = RunMessages(recording)
    return _in_order([*maker.take(recording), *maker.end()])


class RunMessages:
    """Makes the messages of a run from its recording, whole or in parts that follow each other.

    Parameters
    ----------
    first : Recording
        The first part: where the run starts, the robot and the world.
    began : float
        Time [s] of what is there from the start.
    """

    def __init__(self, first: Recording, began: float = 0.0) -> None:
        self._began = began
        self._frame, self._height = first.start.frame_id, first.start.z + message.MAP_LIFT
        self._scene: list[Stamped] | None = list(_static_scene(first, began))
        self._robot = RobotMessages(self._frame, self._height)
        self._moving = MovingFrames(first.robot, self._frame)
        self._track = Track()
        self._mesh = MeshCosts(self._frame)
        self._actions = ActionStates()
        self._plan: list[StampedPoints] = []

    def take(self, part: Recording) -> list[Stamped]:
        """Return the messages of the next part, in the order of time."""
        streams = [
            self._opening(),
            self._moving_frames(part),
            self._pieces(self._track.take(part.times, part.poses)),
            self._plans(part),
            scan_messages(part, self._frame),
            self._robot.take(part, self._began),
            self._maps(part),
            self._objects(part),
            self._events(part.events),
            self._motion(part),
        ]
        messages = _in_order(itertools.chain(*streams))
        self._scene = None  # only now: where a part cannot be made, the next one opens
        return messages

    def end(self) -> list[Stamped]:
        """Return what is left at the end: the last piece of the track."""
        return list(self._pieces(self._track.end()))

    def _opening(self) -> Iterator[Stamped]:
        """What stands, and what the actions do, before anything has happened; once."""
        if self._scene is not None:
            yield from self._scene
            yield _json(self._began, "/actions", "mbf.ActionStates", self._actions.states, part="")

    def _moving_frames(self, part: Recording) -> Iterator[Stamped]:
        for time, make in self._moving.take(part):
            yield Stamped(time, "/tf", make, part="")

    def _pieces(self, pieces: Iterable[tuple[int, float, Any]]) -> Iterator[Stamped]:
        for number, time, line in pieces:
            place = number % MAX_PIECES
            yield Stamped(time, "/scene", partial(scene.track_piece, self._frame, place, time, line), f"track {place}")

    def _plans(self, part: Recording) -> Iterator[Stamped]:
        for time, line in part.paths:
            if len(line):
                yield Stamped(time, "/plan", partial(message.poses_along, time, self._frame, line), part="")

    def _maps(self, part: Recording) -> Iterator[Stamped]:
        for grid in part.grids:
            yield Stamped(grid.time, "/map", partial(message.grid, self._frame, grid, self._height), part="")
        for mesh in part.meshes:
            drawn, make = self._mesh.take(mesh)
            yield Stamped(mesh.time, "/mesh_map", make, drawn)

    def _objects(self, part: Recording) -> Iterator[Stamped]:
        for known in part.objects:
            yield Stamped(known.time, "/objects", partial(scene.tracked_objects, self._frame, known), part="")

    def _events(self, events: Iterable[Event]) -> Iterator[Stamped]:
        for event in events:
            yield Stamped(event.time, "/log", partial(log_message, event))
            yield Stamped(event.time, "/events", partial(event_message, event))
            if self._actions.take(event):
                yield _json(event.time, "/actions", "mbf.ActionStates", self._actions.states, part="")

    def _motion(self, part: Recording) -> Iterator[Stamped]:
        twists, commands = part.twists, part.commands
        off = cross_track_errors(replace(part, paths=[*self._plan, *part.paths]))
        self._plan = [*self._plan, *part.paths][-1:]
        columns = (twists[:, 0], commands[:, 0], twists[:, 2], commands[:, 2], np.degrees(part.tilt), off)
        for time, row in zip(part.times.tolist(), np.column_stack(columns).round(6).tolist(), strict=True):
            finite = {name: value for name, value in zip(MOTION, row, strict=True) if math.isfinite(value)}
            yield _json(time, "/motion", "mbf.Motion", finite)


def _in_order(messages: Iterable[Stamped]) -> list[Stamped]:
    return sorted(messages, key=lambda stamped: stamped.time)


def _json(time: float, topic: str, schema: str, values: Mapping[str, Any], part: str | None = None) -> Stamped:
    return Stamped(time, topic, partial(JsonMessage, schema, values), part)


def _static_scene(recording: Recording, time: float) -> Iterator[Stamped]:
    """Shapes of what stands and what moves; the poses of moving things are on ``/tf``."""
    yield Stamped(time, "/scene", partial(scene.world, recording), "world")
    yield Stamped(time, "/scene", partial(scene.robot, recording.robot), "robot")
    if recording.actors:
        yield Stamped(time, "/scene", partial(scene.actors, recording.actors), "actors")
