"""Arrays as messages of Foxglove's schemas: pure functions, SI units, frames by name, times in seconds.

The schemas are described at https://docs.foxglove.dev/docs/sdk/schemas. ``terrain.viewer.logs.mcap_log`` puts the
messages in a file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry import Pose as Place
from terrain.recording.recorded_maps import RecordedGrid
from terrain.viewer.pictures.colours import Colour
from terrain.viewer.pictures.plan_picture import cost_colours

MAP_LIFT = 0.02  # m that the map floats above the ground, so that both can be seen
MICROMETRES = 6  # decimals of scene coordinates [m]; rounded ones compress to a third


def nanoseconds(time: float) -> int:
    """Return a time [s] as MCAP counts it."""
    return round(time * 1e9)


def timestamp(time: float) -> Timestamp:
    """Return a time [s] as messages carry it."""
    seconds, rest = divmod(nanoseconds(time), 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=rest)


def colour(rgb: Colour) -> Color:
    """Return an opaque colour, 0 to 255 each."""
    red, green, blue = (channel / 255.0 for channel in rgb)
    return Color(r=red, g=green, b=blue, a=1.0)


def pose(position: FloatArray, orientation: FloatArray) -> Pose:
    """Return a pose from x y z [m] and a quaternion x y z w."""
    x, y, z = position.tolist()
    qx, qy, qz, qw = orientation.tolist()
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def transform(time: float, parent: str, child: str, position: FloatArray, orientation: FloatArray) -> FrameTransform:
    """Return where frame ``child`` is in ``parent`` from x y z [m] and a quaternion x y z w."""
    place = pose(position, orientation)
    return FrameTransform(
        timestamp=timestamp(time),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=place.position,
        rotation=place.orientation,
    )


def points(array: FloatArray) -> list[Point3]:
    """Return points (n, 3) [m], rounded to micrometres."""
    return [Point3(x=x, y=y, z=z) for x, y, z in np.round(array, MICROMETRES).tolist()]


def triangles(
    vertices: FloatArray, faces: NDArray[np.int32], colours: NDArray[np.uint8] | Colour
) -> TriangleListPrimitive:
    """Return a mesh in one colour, or with a colour (V, 3) for each vertex."""
    mesh = TriangleListPrimitive(indices=faces.ravel().tolist())
    mesh.MergeFromString(_repeated(mesh.POINTS_FIELD_NUMBER, np.round(vertices, MICROMETRES)))
    mesh.pose.orientation.w = 1.0
    if isinstance(colours, tuple):
        mesh.color.CopyFrom(colour(colours))
    else:
        opaque = np.column_stack([(colours / 255.0).round(3), np.ones(len(colours))])
        mesh.MergeFromString(_repeated(mesh.COLORS_FIELD_NUMBER, opaque))
    return mesh


def _repeated(number: int, rows: FloatArray) -> bytes:
    """Return the field ``number`` with a message for each row (n, d), whose fields 1 to d are its numbers.

    This is protobuf's wire format (protobuf.dev/programming-guides/encoding) of up to 14 doubles; to make a message
    object of each row takes ten times as long.
    """
    count, size = rows.shape
    encoded = np.empty((count, 2 + 9 * size), np.uint8)
    encoded[:, :2] = number << 3 | 2, 9 * size  # 2: what follows is so many bytes
    for k in range(size):
        encoded[:, 2 + 9 * k] = (k + 1) << 3 | 1  # 1: 64 bits follow
        encoded[:, 3 + 9 * k : 11 + 9 * k] = rows[:, k].astype("<f8").view(np.uint8).reshape(count, 8)
    return encoded.tobytes()


def poses_along(time: float, frame: str, line: FloatArray) -> PosesInFrame:
    """Return a path (m, 3) [m] as poses that look along it."""
    ahead = np.diff(line, axis=0, append=line[-1:])
    ahead[-1:] = ahead[-2:-1]
    half = 0.5 * np.arctan2(ahead[:, 1], ahead[:, 0])
    turns = np.column_stack([np.zeros((len(line), 2)), np.sin(half), np.cos(half)])
    poses = [pose(*place) for place in zip(line, turns, strict=True)]
    return PosesInFrame(timestamp=timestamp(time), frame_id=frame, poses=poses)


def poses(time: float, frame: str, places: Sequence[Place]) -> PosesInFrame:
    """Return poses of the navigation."""
    found = [pose(np.array(place.position), np.array(place.orientation)) for place in places]
    return PosesInFrame(timestamp=timestamp(time), frame_id=frame, poses=found)


def pose_in_frame(time: float, frame: str, row: FloatArray) -> PoseInFrame:
    """Return a pose x y z qx qy qz qw (7,)."""
    return PoseInFrame(timestamp=timestamp(time), frame_id=frame, pose=pose(row[:3], row[3:]))


def point_cloud(time: float, frame: str, array: FloatArray) -> PointCloud:
    """Return points (k, 3) [m] as packed 32-bit floats."""
    kind = PackedElementField.FLOAT32
    fields = [PackedElementField(name=name, offset=4 * k, type=kind) for k, name in enumerate("xyz")]
    cloud = PointCloud(timestamp=timestamp(time), frame_id=frame, point_stride=12, fields=fields)
    cloud.pose.orientation.w = 1.0
    cloud.data = array.astype("<f4").tobytes()
    return cloud


def grid(frame: str, recorded: RecordedGrid, height: float) -> Grid:
    """Return a map at a height [m]: a colour for the eye, and the cost as recorded, a byte each."""
    rows, columns = recorded.cells.shape
    x_min, x_max, y_min, y_max = recorded.extent
    pixels = np.full((rows, columns, 5), 255, np.uint8)
    pixels[..., :3] = cost_colours(recorded.costs)
    pixels[..., 4] = recorded.cells
    kind = PackedElementField.UINT8
    names = ("red", "green", "blue", "alpha", "cost")
    return Grid(
        timestamp=timestamp(recorded.time),
        frame_id=frame,
        pose=pose(np.array([x_min, y_min, height]), np.array([0.0, 0.0, 0.0, 1.0])),
        column_count=columns,
        cell_size=Vector2(x=(x_max - x_min) / columns, y=(y_max - y_min) / rows),
        row_stride=5 * columns,
        cell_stride=5,
        fields=[PackedElementField(name=name, offset=k, type=kind) for k, name in enumerate(names)],
        data=pixels.tobytes(),
    )
