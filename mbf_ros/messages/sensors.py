"""Scans of sensor_msgs as our ``RangeScan``, and ours as messages.

A LaserScan is taken as the layers of Nav2 take it: a range of infinity is a ray that met nothing up to ``range_max``,
and a range that is NaN or outside of ``range_min`` to ``range_max`` is no measurement (REP-117).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FARTHEST_COORDINATE, FloatArray
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.maps.sensing import RangeScan
from mbf_ros.messages.geometry import InvalidValueError, MessageContext
from mbf_ros.messages.interfaces import Message

DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
FLOAT32 = 7
AXES = ("x", "y", "z")
CONE_RAYS = 9


def laser_scan_of(message: Message, context: MessageContext, source: str, received: float) -> RangeScan:
    """Return a LaserScan; one without a stamp is as old as its arrival ``received`` [s].

    Raises
    ------
    InvalidValueError
        An angle or a limit is not finite.
    """
    farthest = min(message["range_max"], FARTHEST_COORDINATE)  # drivers send the largest float for a range without end
    nearest, step = message["range_min"], message["angle_increment"]
    _refuse_infinite(message, "angle_min", "angle_increment", "range_min", "range_max")
    ranges = np.asarray(message["ranges"], dtype=np.float64)
    nothing = ranges == np.inf
    measured = (ranges >= nearest) & (ranges <= farthest)
    kept = measured | nothing
    angles = message["angle_min"] + step * np.arange(len(ranges))
    ends = _ends(np.where(nothing, farthest, ranges)[kept], angles[kept])
    return _scan(message, context, source, received, ends, measured[kept])


def range_of(message: Message, context: MessageContext, source: str, received: float) -> RangeScan:
    """Return a sensor_msgs/Range as rays that fill its cone in the plane of the sensor.

    A fixed distance ranger (``min_range`` = ``max_range``) says -infinity for something and infinity for nothing.
    """
    farthest = min(message["max_range"], FARTHEST_COORDINATE)
    measured, opening = message["range"], message["field_of_view"]
    _refuse_infinite(message, "field_of_view", "max_range")
    if measured == -math.inf:
        measured = farthest
    hit = message["min_range"] <= measured <= farthest
    if not hit and measured != math.inf:
        return _scan(message, context, source, received, np.zeros((0, 3)), np.zeros(0, np.bool_))
    angles = opening * (np.arange(CONE_RAYS) / (CONE_RAYS - 1) - 0.5)
    ends = _ends(np.full(CONE_RAYS, measured if hit else farthest), angles)
    return _scan(message, context, source, received, ends, np.full(CONE_RAYS, hit))


def point_cloud_of(message: Message, context: MessageContext, source: str, received: float) -> RangeScan:
    """Return a PointCloud2 as a scan in which every ray hit something; points that are not finite are dropped.

    Raises
    ------
    InvalidValueError
        It has no fields x, y and z, or less data than its size says.
    """
    fields = {field["name"]: field for field in message["fields"]}
    if not fields.keys() >= {*AXES}:
        raise InvalidValueError(f"fields: expected x, y and z, got {', '.join(fields) or 'none'}")
    columns = [_column(message, fields[axis]) for axis in AXES]
    points = np.stack(columns, axis=1)
    points = points[np.isfinite(points).all(axis=1)]
    return _scan(message, context, source, received, points, np.ones(len(points), np.bool_))


def _refuse_infinite(message: Message, *names: str) -> None:
    for name in names:
        if not math.isfinite(message[name]):
            raise InvalidValueError(f"{name}: expected a finite number, got {message[name]}")


def _column(message: Message, field: Message) -> FloatArray:
    """One coordinate of all points, out of the bytes of a cloud."""
    kind = DATATYPES.get(field["datatype"])
    if kind is None:
        known = f"one of {', '.join(map(str, DATATYPES))}"
        raise InvalidValueError(f"fields: datatype of {field['name']!r}: expected {known}, got {field['datatype']}")
    width, height, step, data = message["width"], message["height"], message["point_step"], message["data"]
    dtype = np.dtype((">" if message["is_bigendian"] else "<") + kind)
    row_step = message["row_step"] or width * step
    needed = (height - 1) * row_step + width * step if height and width else 0
    if step < field["offset"] + dtype.itemsize or row_step < width * step or len(data) < needed:
        raise InvalidValueError(
            f"a cloud of {height} x {width} points with point_step {step} and row_step {row_step} needs {needed} bytes "
            f"and room for {field['name']!r} at {field['offset']}, got {len(data)} bytes"
        )
    if not needed:
        return np.zeros(0)
    raw = np.ascontiguousarray(data)
    column = np.ndarray((height, width), dtype, raw.data, field["offset"], (row_step, step))
    return column.astype(np.float64).reshape(-1)


def _ends(ranges: FloatArray, angles: FloatArray) -> FloatArray:
    """Ends (n, 3) of rays in the plane of the sensor; cosines of the C library, equal on every CPU."""
    directions = np.array([(math.cos(angle), math.sin(angle), 0.0) for angle in angles.tolist()]).reshape(-1, 3)
    return np.asarray(ranges[:, None] * directions)


def _scan(
    message: Message, context: MessageContext, source: str, received: float, ends: FloatArray, hits: NDArray[np.bool_]
) -> RangeScan:
    header = message["header"]
    stamp = context.stamp(header["stamp"]) or received
    return RangeScan.of_rays(source, (0.0, 0.0, 0.0), ends, hits, stamp, context.frame(header["frame_id"]))


SENSORS: dict[str, Callable[[Message, MessageContext, str, float], RangeScan]] = {
    "sensor_msgs/LaserScan": laser_scan_of,
    "sensor_msgs/PointCloud2": point_cloud_of,
    "sensor_msgs/Range": range_of,
}
"""What makes a scan of a message, by the types that are read."""


# ------------------------------------------------------------------------------------------------------ to messages
def laser_scan(scan: RangeScan, context: MessageContext, rays: int = 360) -> Message:
    """Return a scan as a LaserScan about its origin: in each of ``rays`` sectors of the plane the nearest hit.

    A sector in which rays met nothing has an infinite range, and one without a ray NaN.
    """
    offsets = scan.ends - scan.origin
    ranges = norm(offsets[:, :2])
    step = 2.0 * math.pi / rays
    angles = [math.atan2(y, x) for x, y in offsets[:, :2].tolist()]
    sectors = np.floor((np.array(angles) + math.pi) / step).astype(np.intp) % rays if angles else np.zeros(0, np.intp)
    nearest = np.full(rays, np.nan)
    nearest[sectors[~scan.hits]] = np.inf
    hits = np.full(rays, np.inf)
    np.minimum.at(hits, sectors[scan.hits], ranges[scan.hits])
    nearest = np.where(np.isfinite(hits), hits, nearest)
    return {
        "header": context.header(scan.frame_id, scan.stamp),
        "angle_min": -math.pi + 0.5 * step,
        "angle_max": math.pi - 0.5 * step,
        "angle_increment": step,
        "time_increment": 0.0,
        "scan_time": 0.0,
        "range_min": 0.0,
        "range_max": float(ranges.max(initial=0.0)),
        "ranges": nearest.astype(np.float32),
        "intensities": np.zeros(0, np.float32),
    }


def point_cloud(points: FloatArray, frame_id: str, stamp: float, context: MessageContext) -> Message:
    """Return points (n, 3) [m] as a PointCloud2 of float32."""
    data = np.ascontiguousarray(points, dtype="<f4")
    step = 12
    return {
        "header": context.header(frame_id, stamp),
        "height": 1,
        "width": len(data),
        "fields": [{"name": axis, "offset": 4 * i, "datatype": FLOAT32, "count": 1} for i, axis in enumerate(AXES)],
        "is_bigendian": False,
        "point_step": step,
        "row_step": step * len(data),
        "data": np.frombuffer(data.tobytes(), np.uint8),
        "is_dense": True,
    }
