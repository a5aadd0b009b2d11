"""What a simulated robot publishes: its transforms, its odometry and its scans, as messages by topic."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

from mbf_abstract.drive.robot import Odometry, RobotStateError
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.session import NavigationSession
from mbf_ros.messages import sensors
from mbf_ros.messages.geometry import MessageContext, odometry_message, transforms_message
from mbf_ros.messages.interfaces import Message

FLAT = 0.02  # m; a scan that leaves its plane by more is no LaserScan
TF, TF_STATIC, ODOM, SCAN, POINTS = "/tf", "/tf_static", "/odom", "/scan", "/points"
SENSOR_TOPICS = {SCAN: "sensor_msgs/LaserScan", POINTS: "sensor_msgs/PointCloud2"}
STATE_TOPICS = {TF: "tf2_msgs/TFMessage", TF_STATIC: "tf2_msgs/TFMessage", ODOM: "nav_msgs/Odometry", **SENSOR_TOPICS}
"""Types of what a robot publishes; late subscribers of ``TF_STATIC`` need its last message, too."""


def state_topics(sensors: Collection[str]) -> dict[str, str]:
    """Return the types of what a robot with these sensors publishes; each of several sensors has its own topics."""
    own = {topic: kind for topic, kind in STATE_TOPICS.items() if len(sensors) < 2 or topic not in SENSOR_TOPICS}
    of_sensors = {topic_of(one, topic, sensors): kind for one in sensors for topic, kind in SENSOR_TOPICS.items()}
    return own | of_sensors


def topic_of(sensor: str, topic: str, sensors: Collection[str]) -> str:
    """Return the topic of a sensor's scans or points: with its name in front where there are others."""
    return f"/{sensor}{topic}" if len(sensors) > 1 else topic


class RobotMessages:
    """Makes messages of what is new of a robot.

    Parameters
    ----------
    session : NavigationSession
        Its server knows the robot, its transforms and its scans. A sensor without a mount sits where its first scan
        began; its scans are published where there is one sensor at most.
    is_wanted : callable
        Whether somebody listens to a topic; scans that nobody wants are not converted.
    """

    def __init__(self, session: NavigationSession, context: MessageContext, is_wanted: Callable[[str], bool]) -> None:
        self._server, self._context, self._is_wanted = session.navigator.server, context, is_wanted
        self._sensors, self._mounts = tuple(session.sensor_mounts), dict(session.sensor_mounts)
        self._scans: dict[str, RangeScan] = {}
        self._static: list[Transform] = []
        self._stamps: dict[str, float] = {}
        self._server.scan_listeners.append(self._take_scan)

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
        newest = [*self._server.runtime.transforms.newest(), *self._mounts.values()]
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
        scans, self._scans = self._scans, {}
        for source, scan in scans.items():
            topics = {topic: topic_of(source, topic, self._sensors) for topic in SENSOR_TOPICS}
            has_topics = source in self._sensors or len(self._sensors) < 2
            if not (has_topics and any(map(self._is_wanted, topics.values()))):
                continue
            try:
                own = scan.in_frame(self._server.runtime.robot.robot_frame, self._server.runtime.transforms)
            except TransformError:
                continue  # it is older than what is known of the robot
            x, y, z = own.origin.tolist()
            self._mounts.setdefault(source, Transform((x, y, z), parent=own.frame_id, child=source, static=True))
            sensor = replace(own, origin=own.origin - own.origin, ends=own.ends - own.origin, frame_id=source)
            if abs(sensor.ends[:, 2]).max(initial=0.0) < FLAT:
                yield topics[SCAN], sensors.laser_scan(sensor, self._context)
            yield topics[POINTS], sensors.point_cloud(sensor.points, source, own.stamp, self._context)
