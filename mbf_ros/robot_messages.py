"""What a simulated robot publishes: its transforms, its odometry and its scans, as messages by topic."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from mbf_abstract.drive.robot import Odometry, RobotStateError
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages import sensors
from mbf_ros.messages.geometry import MessageContext, odometry_message, transforms_message
from mbf_ros.messages.interfaces import Message

FLAT = 0.02  # m; a scan that leaves its plane by more is no LaserScan
TF, TF_STATIC, ODOM, SCAN, POINTS = "/tf", "/tf_static", "/odom", "/scan", "/points"
STATE_TOPICS = {
    TF: "tf2_msgs/TFMessage",
    TF_STATIC: "tf2_msgs/TFMessage",
    ODOM: "nav_msgs/Odometry",
    SCAN: "sensor_msgs/LaserScan",
    POINTS: "sensor_msgs/PointCloud2",
}
"""Types of what a robot publishes; late subscribers of ``TF_STATIC`` need its last message, too."""


class RobotMessages:
    """Makes messages of what is new of a robot.

    Parameters
    ----------
    server : AbstractNavigationServer
        Knows the robot, its transforms and its scans.
    context : MessageContext
    is_wanted : callable
        Whether somebody listens to a topic; scans that nobody wants are not converted.
    """

    def __init__(
        self, server: AbstractNavigationServer, context: MessageContext, is_wanted: Callable[[str], bool]
    ) -> None:
        self._server, self._context, self._is_wanted = server, context, is_wanted
        self._scans: dict[str, RangeScan] = {}
        self._static: list[Transform] = []
        self._stamps: dict[str, float] = {}
        self._sensor_frames: dict[str, Transform] = {}
        server.scan_listeners.append(self._take_scan)

    def close(self) -> None:
        """Take no more scans."""
        self._server.scan_listeners.remove(self._take_scan)

    def changes(self) -> Iterator[tuple[str, Message]]:
        """Yield topics and their messages; scans after the transforms that place them."""
        scans = list(self._scan_messages())
        yield from self._transforms()
        yield from self._odometry()
        yield from scans

    def _transforms(self) -> Iterator[tuple[str, Message]]:
        newest = [*self._server.runtime.transforms.newest(), *self._sensor_frames.values()]
        static = [one for one in newest if one.static]
        moved = [one for one in newest if not one.static and self._stamps.get(one.child) != one.stamp]
        self._stamps |= {one.child: one.stamp for one in moved}
        if moved:
            yield TF, transforms_message(moved, self._context)
        if static != self._static:
            self._static = static
            yield TF_STATIC, transforms_message(static, self._context)

    def _odometry(self) -> Iterator[tuple[str, Message]]:
        runtime = self._server.runtime
        try:
            velocity, pose = runtime.robot.measured_velocity(), runtime.robot.pose()
        except RobotStateError:
            return  # who waits for odometry sees that there is none
        if velocity is not None:
            T_map_base = Transform.from_pose(pose, runtime.robot.robot_frame)
            found = next((one for one in runtime.transforms.newest() if one.child == T_map_base.child), T_map_base)
            yield ODOM, odometry_message(Odometry(velocity, pose.stamp), found, self._context)

    def _take_scan(self, scan: RangeScan) -> None:
        self._scans[scan.source] = scan

    def _scan_messages(self) -> Iterator[tuple[str, Message]]:
        wanted = self._is_wanted(SCAN) or self._is_wanted(POINTS)
        scans, self._scans = self._scans, {}
        for scan in scans.values() if wanted else ():
            try:
                own = scan.in_frame(self._server.runtime.robot.robot_frame, self._server.runtime.transforms)
            except TransformError:
                continue  # it is older than what is known of the robot
            sensor = replace(own, origin=own.origin - own.origin, ends=own.ends - own.origin, frame_id=own.source)
            x, y, z = own.origin.tolist()
            self._sensor_frames[own.source] = Transform(
                (x, y, z), parent=own.frame_id, child=own.source, stamp=own.stamp
            )
            if abs(sensor.ends[:, 2]).max(initial=0.0) < FLAT:
                yield SCAN, sensors.laser_scan(sensor, self._context)
            yield POINTS, sensors.point_cloud(sensor.points, own.source, own.stamp, self._context)
