"""The world of a run, its robot and its actors as Foxglove scene entities."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.KeyValuePair_pb2 import KeyValuePair
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from terrain.recording.actor_track import ActorTrack
from terrain.recording.recorded_objects import RecordedObjects
from terrain.recording.recorded_robot import RobotShape
from terrain.recording.recording import Recording
from terrain.viewer.logs.foxglove_messages import colour, points, pose, timestamp, triangles
from terrain.viewer.pictures.colours import ACTORS, BODY, DRIVEN, PLANNED, TRACKED, WHEEL, Colour
from terrain.viewer.pictures.shading import vertex_colours
from terrain.viewer.pictures.shapes import marks, robot_body, standing_things
from terrain.worlds.surface import Surface

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
ALONG_Y = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])  # a quarter turn about x: a cylinder's axis along y
BALL = 0.4  # m
TEXT = 18.0  # pixels
TRACK_WIDTH = 4.0  # pixels
LIFT, SHAFT, HEAD = 0.05, 0.05, 0.2  # m; of tracked objects and their arrows


def world(recording: Recording) -> SceneUpdate:
    """Ground, walls, obstacles, start and goals; they stay for the whole run."""
    frame = recording.start.frame_id
    entities = [_solid(frame, *thing) for thing in standing_things(recording)]
    if recording.ground is not None:
        entities.append(_solid(frame, "ground", recording.ground, vertex_colours(recording.ground)))
    return SceneUpdate(entities=[*entities, *(_mark(*mark) for mark in marks(recording))])


def robot(shape: RobotShape) -> SceneUpdate:
    """The body in ``base_link`` and each wheel in a frame of its own, so that it can turn."""
    entities = [_solid("base_link", "body", robot_body(shape), BODY)]
    for index in range(len(shape.wheels)):
        diameter, width = 2.0 * shape.wheel_radius, 0.64 * shape.wheel_radius
        drum = CylinderPrimitive(
            pose=pose(np.zeros(3), ALONG_Y),
            size=Vector3(x=diameter, y=diameter, z=width),
            bottom_scale=1.0,
            top_scale=1.0,
            color=colour(WHEEL),
        )
        entity = _entity(wheel_frame(index), f"wheel {index}")
        entity.cylinders.append(drum)
        entities.append(entity)
    return SceneUpdate(entities=entities)


def actors(tracks: Sequence[ActorTrack]) -> SceneUpdate:
    """People, doors and other robots, each in a frame of its own."""
    return SceneUpdate(
        entities=[
            _solid(
                actor_frame(index), f"{track.thing} {index}", Surface(track.vertices, track.faces), ACTORS[track.thing]
            )
            for index, track in enumerate(tracks)
        ]
    )


def actor_frame(index: int) -> str:
    """Name of an actor's frame."""
    return f"actor_{index}"


def wheel_frame(index: int) -> str:
    """Name of a wheel's frame."""
    return f"wheel_{index}"


def track_piece(frame: str, number: int, time: float, line: FloatArray) -> SceneUpdate:
    """A piece (m, 3) [m] of the driven track."""
    entity = _entity(frame, f"track {number}")
    entity.timestamp.CopyFrom(timestamp(time))
    entity.lines.append(
        LinePrimitive(
            type=LinePrimitive.LINE_STRIP,
            pose=pose(np.zeros(3), UPRIGHT),
            thickness=TRACK_WIDTH,
            scale_invariant=True,
            points=points(line),
            color=colour(DRIVEN),
        )
    )
    return SceneUpdate(entities=[entity])


def footprint(frame: str, time: float, corners: FloatArray) -> SceneUpdate:
    """The outline (k, 3) [m] of the robot, in its frame."""
    entity = _entity(frame, "footprint")
    entity.timestamp.CopyFrom(timestamp(time))
    entity.lines.append(
        LinePrimitive(
            type=LinePrimitive.LINE_LOOP,
            pose=pose(np.array([0.0, 0.0, LIFT]), UPRIGHT),
            thickness=TRACK_WIDTH,
            scale_invariant=True,
            points=points(corners),
            color=colour(PLANNED),
        )
    )
    return SceneUpdate(entities=[entity])


def tracked_objects(frame: str, known: RecordedObjects) -> SceneUpdate:
    """A flat disc for each object, and for those that move an arrow to where they will be in a second."""
    stamp = timestamp(known.time)
    before = SceneEntityDeletion(type=SceneEntityDeletion.ALL, timestamp=stamp)
    return SceneUpdate(deletions=[before], entities=[_object(frame, known.time, row) for row in known.rows])


def _object(frame: str, time: float, row: FloatArray) -> SceneEntity:
    number, x, y, z, vx, vy, radius, age, is_moving = row.tolist()
    entity, middle = _entity(frame, f"object {number:.0f}"), np.array([x, y, z + LIFT])
    entity.timestamp.CopyFrom(timestamp(time))
    facts = {"motion": "moving" if is_moving else "standing", "vx": f"{vx:.3f}", "vy": f"{vy:.3f}", "age": f"{age:.2f}"}
    entity.metadata.extend(KeyValuePair(key=key, value=value) for key, value in facts.items())
    size = Vector3(x=2.0 * radius, y=2.0 * radius, z=LIFT)
    paint = colour(TRACKED)
    entity.cylinders.append(
        CylinderPrimitive(pose=pose(middle, UPRIGHT), size=size, bottom_scale=1.0, top_scale=1.0, color=paint)
    )
    speed = math.hypot(vx, vy)
    if speed > 0.0:
        half = 0.5 * math.atan2(vy, vx)
        ahead = pose(middle, np.array([0.0, 0.0, math.sin(half), math.cos(half)]))
        head = min(HEAD, 0.5 * speed)
        entity.arrows.append(
            ArrowPrimitive(
                pose=ahead,
                shaft_length=speed - head,
                shaft_diameter=SHAFT,
                head_length=head,
                head_diameter=3.0 * SHAFT,
                color=paint,
            )
        )
    return entity


def _entity(frame: str, name: str) -> SceneEntity:
    return SceneEntity(frame_id=frame, id=name, frame_locked=True, timestamp=timestamp(0.0))


def _solid(frame: str, name: str, surface: Surface, colours: NDArray[np.uint8] | Colour) -> SceneEntity:
    entity = _entity(frame, name)
    entity.triangles.append(triangles(surface.vertices, surface.faces, colours))
    return entity


def _mark(name: str, at: Pose, paint: Colour) -> SceneEntity:
    entity = _entity(at.frame_id, name)
    size = Vector3(x=BALL, y=BALL, z=BALL)
    entity.spheres.append(SpherePrimitive(pose=pose(np.array(at.position), UPRIGHT), size=size, color=colour(paint)))
    above = pose(np.array(at.position) + np.array([0.0, 0.0, 2.0 * BALL]), UPRIGHT)
    label = TextPrimitive(
        pose=above, billboard=True, font_size=TEXT, scale_invariant=True, color=colour(paint), text=name
    )
    entity.texts.append(label)
    return entity
