"""A recording as a stream of messages by topic, in Foxglove's schemas where there is one and as JSON where not.

========== ================================ =====================================================
topic      schema                           contents
========== ================================ =====================================================
/tf        foxglove.FrameTransforms         true pose of ``base_link``, of wheels and of actors
/scene     foxglove.SceneUpdate             ground, walls, obstacles, marks, robot, actors, track
/plan      foxglove.PosesInFrame            every plan the robot followed
/scan      foxglove.PointCloud              what a range sensor hit
/map       foxglove.Grid                    the map, where it is a grid
/mesh_map  foxglove.SceneUpdate             the map, where it is a mesh, in the colours of its costs
/log       foxglove.Log                     events as text
/events    mbf.Event                        events as in events.jsonl
/actions   mbf.ActionStates                 what each action does
/motion    mbf.Motion                       speed, yaw rate, their commands, tilt, cross-track error
========== ================================ =====================================================
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log

from mbf_abstract.events import Event, EventKind
from mbf_abstract.geometry import FloatArray
from mbf_abstract.outcomes import is_success, outcome_name
from terrain.recording.metrics import cross_track_errors
from terrain.recording.recording import Recording
from terrain.viewer.logs import foxglove_mesh_costs as mesh_costs
from terrain.viewer.logs import foxglove_messages as message
from terrain.viewer.logs import foxglove_scene as scene
from terrain.viewer.reports.event_lines import NOTABLE, event_text
from terrain.viewer.reports.timeline import ACTIONS
from terrain.viewer.scene import wheel_angles

TRACK_PIECE = 5.0  # s
ERRORS = {EventKind.FAULT, EventKind.QUARANTINE, EventKind.SINK_FAILED}
DETAILS = {EventKind.STATE_CHANGED, EventKind.PLUGIN_CALL_STARTED, EventKind.PLUGIN_CALL_ENDED}
NUMBER, TEXT = {"type": "number"}, {"type": "string"}
MOTION = ("speed", "commanded_speed", "yaw_rate", "commanded_yaw_rate", "tilt_deg", "cross_track_error")
JSON_FIELDS: dict[str, dict[str, Any]] = {
    "mbf.Event": {"time": NUMBER, "kind": TEXT, "source": TEXT, "data": {"type": "object"}},
    "mbf.ActionStates": dict.fromkeys(ACTIONS, TEXT),
    "mbf.Motion": dict.fromkeys(MOTION, NUMBER),
}


@dataclass(frozen=True)
class JsonMessage:
    """A message of a schema of our own: ``values`` are written as JSON."""

    schema: str
    values: Mapping[str, Any]

    def json_schema(self) -> dict[str, Any]:
        """The schema's text: every field it may have."""
        return {"title": self.schema, "type": "object", "properties": JSON_FIELDS[self.schema]}


Stamped = tuple[float, str, Any]  # time [s], topic, a protobuf message or a JsonMessage


def messages_of(recording: Recording) -> list[Stamped]:
    """All messages of a run, in the order of time."""
    frame, height = recording.start.frame_id, recording.start.z + message.MAP_LIFT
    streams: list[Iterator[Stamped]] = [
        ((0.0, "/scene", update) for update in _static_scene(recording)),
        _transforms(recording),
        _track(recording),
        ((time, "/plan", message.poses_along(time, frame, line)) for time, line in recording.paths if len(line)),
        ((time, "/scan", message.point_cloud(time, frame, points)) for time, points in recording.scans),
        ((grid.time, "/map", message.grid(frame, grid, height)) for grid in recording.grids),
        ((mesh.time, "/mesh_map", update) for mesh, update in mesh_costs.updates(frame, recording.meshes)),
        ((event.time, "/log", _log(event)) for event in recording.events),
        ((event.time, "/events", _event(event)) for event in recording.events),
        action_states(recording.events),
        _motion(recording),
    ]
    return sorted(itertools.chain(*streams), key=lambda stamped: stamped[0])


def _static_scene(recording: Recording) -> Iterator[Any]:
    """Shapes of what stands and what moves; the poses of moving things are on ``/tf``."""
    yield scene.world(recording)
    yield scene.robot(recording.robot)
    if recording.actors:
        yield scene.actors(recording.actors)


def action_states(events: tuple[Event, ...]) -> Iterator[Stamped]:
    """What every action does, whenever that changes: idle, active, or the outcome of its last goal."""
    states, newest = dict.fromkeys(ACTIONS, "idle"), dict.fromkeys(ACTIONS)
    yield 0.0, "/actions", JsonMessage("mbf.ActionStates", dict(states))
    for event in events:
        action, goal = event.source, event.data.get("goal_id")
        if action not in states:
            continue
        if event.kind is EventKind.GOAL_ACCEPTED:
            states[action], newest[action] = "active", goal
        elif event.kind is EventKind.GOAL_FINISHED and goal == newest[action]:
            code = event.data.get("outcome")
            states[action] = outcome_name(code) if isinstance(code, int) else "finished"
        else:
            continue
        yield event.time, "/actions", JsonMessage("mbf.ActionStates", dict(states))


def _transforms(recording: Recording) -> Iterator[Stamped]:
    shape, frame = recording.robot, recording.start.frame_id
    angles = wheel_angles(shape, recording.times, recording.twists)
    for sample, (time, row) in enumerate(zip(recording.times.tolist(), recording.poses, strict=True)):
        body = message.transform(time, frame, "base_link", row[:3], row[3:])
        wheels = [
            message.transform(time, "base_link", scene.wheel_frame(index), centre, _about_y(angle))
            for index, (centre, angle) in enumerate(zip(shape.wheels, angles[sample].tolist(), strict=True))
        ]
        actors = [
            message.transform(time, frame, scene.actor_frame(index), track.poses[sample, :3], track.poses[sample, 3:])
            for index, track in enumerate(recording.actors)
        ]
        yield time, "/tf", FrameTransforms(transforms=[body, *wheels, *actors])


def _about_y(angle: float) -> FloatArray:
    return np.array([0.0, math.sin(angle / 2.0), 0.0, math.cos(angle / 2.0)])


def _track(recording: Recording) -> Iterator[Stamped]:
    """Pieces of the driven track, each when it has been driven."""
    ends = np.arange(TRACK_PIECE, recording.duration + TRACK_PIECE, TRACK_PIECE)
    last = 0
    for number, end in enumerate(np.searchsorted(recording.times, ends)):
        index = min(int(end), len(recording.times) - 1)
        if index > last:
            time, line = float(recording.times[index]), recording.poses[last : index + 1, :3]
            yield time, "/scene", scene.track_piece(recording.start.frame_id, number, time, line)
        last = index


def _log(event: Event) -> Log:
    text = f"{event.kind.value}: {event_text(event)}"
    return Log(timestamp=message.timestamp(event.time), level=_level(event), message=text, name=event.source)


def _level(event: Event) -> Log.Level.ValueType:
    if event.kind in ERRORS:
        return Log.ERROR
    code = event.data.get("outcome")
    failed = event.kind is EventKind.GOAL_FINISHED and isinstance(code, int) and not is_success(code)
    if event.kind in NOTABLE or failed:
        return Log.WARNING
    return Log.DEBUG if event.kind in DETAILS else Log.INFO


def _event(event: Event) -> JsonMessage:
    return JsonMessage("mbf.Event", json.loads(event.to_json()))


def _motion(recording: Recording) -> Iterator[Stamped]:
    twists, commands = recording.twists, recording.commands
    tilt, off = np.degrees(recording.tilt), cross_track_errors(recording)
    columns = (twists[:, 0], commands[:, 0], twists[:, 2], commands[:, 2], tilt, off)
    for time, row in zip(recording.times.tolist(), np.column_stack(columns).round(6).tolist(), strict=True):
        finite = {name: value for name, value in zip(MOTION, row, strict=True) if math.isfinite(value)}
        yield time, "/motion", JsonMessage("mbf.Motion", finite)
