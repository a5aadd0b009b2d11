"""What the robot reports of itself as messages: where it believes to be, its odometry, its outline, its local map.

True poses are on ``/tf`` as ``base_link``. The frame ``base_link_estimated`` is where the localisation has the robot:
in ``odom`` where there is odometry, which the localisation then moves in the map (REP-105), else in the map.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.geometry.transform import Transform
from terrain.recording.recorded_robot import RobotReports
from terrain.recording.recording import Recording
from terrain.viewer.logs import foxglove_messages as message
from terrain.viewer.logs import foxglove_scene as scene
from terrain.viewer.logs.event_messages import JsonMessage, Stamped

ESTIMATED, ODOM, BODY = "base_link_estimated", "odom", "base_link"
ODOMETRY = "mbf.Odometry"
DECIMALS = 6


class RobotMessages:
    """Makes the messages of what a robot reports, from parts that follow each other.

    Parameters
    ----------
    frame : str
        Of the map.
    height : float
        Of a local map [m].
    """

    def __init__(self, frame: str, height: float) -> None:
        self._frame, self._height = frame, height
        self._goals: tuple[Pose, ...] = ()

    def take(self, part: Recording, began: float) -> Iterator[Stamped]:
        """Yield the messages of a part; ``began`` [s] is the time of its goals if it has no sample."""
        yield from self._new_goals(part, began)
        reports = part.reports
        for sample, time in enumerate(part.times.tolist()[: len(reports.rows)]):
            if np.isfinite(reports.estimates[sample]).all():
                make = partial(message.pose_in_frame, time, self._frame, reports.estimates[sample])
                yield Stamped(time, "/estimated_pose", make, part="")
            if np.isfinite(reports.velocities[sample]).all():
                yield Stamped(time, "/odom", partial(self._odometry, reports, sample), part="")
        for time, corners in reports.outlines:
            frame = ESTIMATED if np.isfinite(reports.estimates).any() else BODY
            yield Stamped(time, "/footprint", partial(scene.footprint, frame, time, corners), part="")
        for grid in reports.local_grids:
            make = partial(message.grid, reports.local_frame, grid, self._height + message.MAP_LIFT)
            yield Stamped(grid.time, "/local_map", make, part="")

    def _new_goals(self, part: Recording, began: float) -> Iterator[Stamped]:
        if part.goals != self._goals:
            self._goals = part.goals
            time = float(part.times[0]) if len(part.times) else began
            yield Stamped(time, "/goals", partial(message.poses, time, self._frame, part.goals), part="")

    def _odometry(self, reports: RobotReports, sample: int) -> JsonMessage:
        """As nav_msgs/Odometry; the pose is that of the localisation where there is no other, or absent."""
        has_odometry = bool(np.isfinite(reports.odometry[sample]).all())
        row = (reports.odometry if has_odometry else reports.estimates)[sample]
        vx, vy, wz = reports.velocities[sample].round(DECIMALS).tolist()
        values: dict[str, Any] = {
            "frame_id": ODOM if has_odometry else self._frame,
            "child_frame_id": BODY,
            "twist": {"linear": {"x": vx, "y": vy, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": wz}},
        }
        if np.isfinite(row).all():
            x, y, z, qx, qy, qz, qw = row.round(DECIMALS).tolist()
            turn = {"x": qx, "y": qy, "z": qz, "w": qw}
            values["pose"] = {"position": {"x": x, "y": y, "z": z}, "orientation": turn}
        return JsonMessage(ODOMETRY, values)


def reported_frames(reports: RobotReports, frame: str, sample: int, time: float) -> list[FrameTransform]:
    """Return the frames that a robot reports at a sample, and those of its sensors."""
    found = [message.transform(time, BODY, name, row[:3], row[3:]) for name, row in reports.mounts.items()]
    if sample >= len(reports.rows) or not np.isfinite(reports.estimates[sample]).all():
        return found
    estimate, odometry = reports.estimates[sample], reports.odometry[sample]
    if not np.isfinite(odometry).all():
        return [*found, message.transform(time, frame, ESTIMATED, estimate[:3], estimate[3:])]
    T_map_base, T_odom_base = _transform(estimate, frame, ESTIMATED), _transform(odometry, ODOM, ESTIMATED)
    T_map_odom = T_map_base @ T_odom_base.inverse()
    place, turn = np.array(T_map_odom.translation), np.array(T_map_odom.rotation)
    return [
        *found,
        message.transform(time, frame, ODOM, place, turn),
        message.transform(time, ODOM, ESTIMATED, odometry[:3], odometry[3:]),
    ]


def scan_messages(part: Recording, frame: str) -> Iterator[Stamped]:
    """Yield the scans in the frames of their sensors; in the map where a sensor's frame is not known."""
    reports = part.reports
    for number, (time, points) in enumerate(part.scans):
        name = reports.scan_sensors[number] if number < len(reports.scan_sensors) else ""
        if name in reports.mounts:
            row = np.concatenate([part.scan_origins[number], reports.scan_orientations[number]])
            make = partial(_in_sensor, time, _transform(row, frame, name), points)
        else:
            make = partial(message.point_cloud, time, frame, points)
        yield Stamped(time, "/scan", make, part="")


def _in_sensor(time: float, T_map_sensor: Transform, points: FloatArray) -> PointCloud:
    return message.point_cloud(time, T_map_sensor.child, T_map_sensor.inverse().apply(points))


def _transform(row: FloatArray, parent: str, child: str) -> Transform:
    x, y, z, qx, qy, qz, qw = row.tolist()
    return Transform((x, y, z), (qx, qy, qz, qw), parent, child)
