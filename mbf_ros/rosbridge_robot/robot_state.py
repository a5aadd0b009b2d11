"""What a simulated robot publishes: its transforms, its odometry and its scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from mbf_abstract.drive.robot import Odometry, RobotStateError
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_ros.messages import sensors
from mbf_ros.messages.geometry import MessageContext, odometry_message, transforms_message
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.topics import TopicTable

FLAT = 0.02  # m; a scan that leaves its plane by more is no LaserScan


class RobotState:
    """Publishes the state of a robot when it is asked to.

    Parameters
    ----------
    server : AbstractNavigationServer
        Knows the robot and its transforms.
    topics : TopicTable
    context : MessageContext
    send : callable
        Publishes a message on a topic.
    """

    def __init__(
        self,
        server: AbstractNavigationServer,
        topics: TopicTable,
        context: MessageContext,
        send: Callable[[str, Message], None],
    ) -> None:
        self._server, self._topics, self._context, self._send = server, topics, context, send
        self._scans: dict[str, RangeScan] = {}
        self._static: list[Transform] = []
        self._stamps: dict[str, float] = {}
        self._sensor_frames: dict[str, Transform] = {}
        for name, kind in (
            ("/tf", "tf2_msgs/TFMessage"),
            ("/odom", "nav_msgs/Odometry"),
            ("/scan", "sensor_msgs/LaserScan"),
            ("/points", "sensor_msgs/PointCloud2"),
        ):
            topics.add_output(name, kind)
        topics.add_output("/tf_static", "tf2_msgs/TFMessage", latched=True)
        server.scan_listeners.append(self._take_scan)

    def close(self) -> None:
        """Take no more scans."""
        self._server.scan_listeners.remove(self._take_scan)

    def publish(self) -> None:
        """Publish what is new."""
        self._publish_transforms()
        self._publish_odometry()
        self._publish_scans()

    def _publish_transforms(self) -> None:
        newest = [*self._server.runtime.transforms.newest(), *self._sensor_frames.values()]
        static = [one for one in newest if one.static]
        moved = [one for one in newest if not one.static and self._stamps.get(one.child) != one.stamp]
        self._stamps |= {one.child: one.stamp for one in moved}
        if moved:
            self._send("/tf", transforms_message(moved, self._context))
        if static != self._static:
            self._static = static
            self._send("/tf_static", transforms_message(static, self._context))

    def _publish_odometry(self) -> None:
        runtime = self._server.runtime
        try:
            velocity, pose = runtime.robot.measured_velocity(), runtime.robot.pose()
        except RobotStateError:
            return  # who waits for odometry sees that there is none
        if velocity is not None:
            T_map_base = Transform.from_pose(pose, runtime.robot.robot_frame)
            found = next((one for one in runtime.transforms.newest() if one.child == T_map_base.child), T_map_base)
            self._send("/odom", odometry_message(Odometry(velocity, pose.stamp), found, self._context))

    def _take_scan(self, scan: RangeScan) -> None:
        self._scans[scan.source] = scan

    def _publish_scans(self) -> None:
        wanted = self._topics.is_wanted("/scan") or self._topics.is_wanted("/points")
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
                self._send("/scan", sensors.laser_scan(sensor, self._context))
            self._send("/points", sensors.point_cloud(sensor.points, own.source, own.stamp, self._context))
