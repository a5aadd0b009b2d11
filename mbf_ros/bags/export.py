"""A drive as standard messages of ROS 2, in the order of time.

========================== =========================== ======================================================
topic                      type                        contents
========================== =========================== ======================================================
/tf_static                 tf2_msgs/TFMessage          odom in map: the same, as the poses are true
/tf                        tf2_msgs/TFMessage          the robot in odom; its sensor, at each scan
/odom                      nav_msgs/Odometry           true pose and measured velocity
/cmd_vel                   geometry_msgs/Twist         the command of the time
/points                    sensor_msgs/PointCloud2     what a range sensor hit, in the sensor's frame
/plan                      nav_msgs/Path               every plan that the robot followed
/global_costmap/costmap    nav_msgs/OccupancyGrid      the costs of a grid
/mesh_map                  visualization_msgs/Marker.. a mesh in the colours of its costs
========================== =========================== ======================================================

A recording keeps the points that its sensors hit, and not the rays that met nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import merge

import numpy as np

from mbf_abstract.drive.robot import Odometry
from mbf_abstract.drive_log import DriveLog, LoggedScan
from mbf_abstract.geometry import FloatArray, Path, Twist
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.maps.view import GridView, MapView
from mbf_ros.bags.writing import BagMessage
from mbf_ros.messages.geometry import (
    NANOSECONDS,
    MessageContext,
    odometry_message,
    path_message,
    transforms_message,
    twist,
)
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.maps import mesh_markers, occupancy_cells, occupancy_grid
from mbf_ros.messages.sensors import point_cloud

ODOM, SENSOR = "odom", "range_sensor"
EPOCH = 1.0
"""ROS time [s] at which a drive begins; 0 would mean that a message has no stamp."""
ORDER = ("/tf_static", "/tf", "/odom", "/cmd_vel", "/points", "/plan", "/global_costmap/costmap", "/mesh_map")
"""Of messages of the same time; transforms come before what they place."""
TF = "tf2_msgs/TFMessage"


def messages_of(log: DriveLog, robot_frame: str = "base_link") -> Iterator[BagMessage]:
    """Make all messages of a drive, one after the other; times before its first sample are written at that."""
    context = MessageContext(log.frame_id, EPOCH)
    fixed = Transform((0.0, 0.0, 0.0), parent=log.frame_id, child=ODOM, static=True)
    static = [_message(0.0, "/tf_static", TF, transforms_message([fixed], context), latched=True)]
    track = _Track(log, robot_frame)
    samples = range(len(log.times))
    scans = sorted(log.scans, key=lambda scan: scan.time) if len(log.times) else []
    paths = sorted(((time, points) for time, points in log.paths if len(points)), key=lambda one: one[0])
    in_order: list[Iterable[BagMessage]] = [  # one topic each, as those of the same time are sorted by topic
        static,
        (_place(track.sample(sample), context) for sample in samples),
        (_sensor_place(scan, track, context) for scan in scans),
        (_odometry(log, sample, track, context) for sample in samples),
        (_command(log, sample, context) for sample in samples),
        (_cloud(scan, track, context) for scan in scans),
        (_planned(time, points, context) for time, points in paths),
        (_mapped(time, view, context) for time, view in sorted(log.maps, key=lambda one: one[0])),
    ]
    return merge(*in_order, key=lambda one: (one.time, ORDER.index(one.topic)))


class _Track:
    """The robot in odom at any time: as a transform buffer interpolates it, and at rest before and after."""

    def __init__(self, log: DriveLog, robot_frame: str) -> None:
        self._times = log.times
        self._samples = [
            Transform(tuple(row[:3]), tuple(row[3:]), ODOM, robot_frame, time)
            for time, row in zip(log.times.tolist(), log.poses.tolist(), strict=True)
        ]

    def sample(self, number: int) -> Transform:
        return self._samples[number]

    def at(self, time: float) -> Transform:
        later = int(np.searchsorted(self._times, time))
        if later == 0 or later == len(self._samples):
            nearest = self._samples[min(later, len(self._samples) - 1)]
            return Transform(nearest.translation, nearest.rotation, nearest.parent, nearest.child, time)
        return self._samples[later - 1].interpolate(self._samples[later], time)


def _place(T_odom_base: Transform, context: MessageContext) -> BagMessage:
    return _message(T_odom_base.stamp, "/tf", TF, transforms_message([T_odom_base], context))


def _odometry(log: DriveLog, sample: int, track: _Track, context: MessageContext) -> BagMessage:
    T_odom_base = track.sample(sample)
    odometry = odometry_message(Odometry(_twist(log.twists[sample]), T_odom_base.stamp), T_odom_base, context)
    return _message(T_odom_base.stamp, "/odom", "nav_msgs/Odometry", odometry)


def _command(log: DriveLog, sample: int, context: MessageContext) -> BagMessage:
    command = twist(_twist(log.commands[sample]))
    return _message(float(log.times[sample]), "/cmd_vel", "geometry_msgs/Twist", command)


def _sensor_place(scan: LoggedScan, track: _Track, context: MessageContext) -> BagMessage:
    """Where the robot and the sensor were at the moment of a scan."""
    return _message(scan.time, "/tf", TF, transforms_message(list(_sensor_steps(scan, track)), context))


def _cloud(scan: LoggedScan, track: _Track, context: MessageContext) -> BagMessage:
    T_odom_base, T_base_sensor = _sensor_steps(scan, track)
    points = (T_odom_base @ T_base_sensor).inverse().apply(scan.points)
    return _message(scan.time, "/points", "sensor_msgs/PointCloud2", point_cloud(points, SENSOR, scan.time, context))


def _sensor_steps(scan: LoggedScan, track: _Track) -> tuple[Transform, Transform]:
    """``T_odom_base`` and ``T_base_sensor`` at the moment of a scan: the sensor looks where the robot looks."""
    T_odom_base = track.at(scan.time)
    origin = T_odom_base.inverse().apply(scan.origin[None, :])[0]
    return T_odom_base, Transform(tuple(origin.tolist()), parent=T_odom_base.child, child=SENSOR, stamp=scan.time)


def _planned(time: float, points: FloatArray, context: MessageContext) -> BagMessage:
    path = Path.from_points(points, frame_id=context.global_frame, stamp=time)
    return _message(time, "/plan", "nav_msgs/Path", path_message(path, context))


def _mapped(time: float, view: MapView, context: MessageContext) -> BagMessage:
    frame = context.global_frame
    if isinstance(view, GridView):
        grid = occupancy_grid(occupancy_cells(view.costs), view.extent, frame, time, context)
        return _message(time, "/global_costmap/costmap", "nav_msgs/OccupancyGrid", grid, latched=True)
    markers = mesh_markers(view, frame, time, context)
    return _message(time, "/mesh_map", "visualization_msgs/MarkerArray", markers, latched=True)


def _twist(row: FloatArray) -> Twist:
    vx, vy, wz = np.nan_to_num(row).tolist()
    return Twist((vx, vy, 0.0), (0.0, 0.0, wz))


def _message(time: float, topic: str, kind: str, content: Message, latched: bool = False) -> BagMessage:
    return BagMessage(round((time + EPOCH) * NANOSECONDS), topic, kind, content, latched)
