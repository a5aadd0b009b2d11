"""What the navigator publishes: commands, plans, maps, events, and for a simulated robot also its tf, odometry, scans.

One thread reads the state at a fixed rate and makes the messages that somebody listens to, each once for all of them.
The control loop is not part of it and never waits for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace

from mbf_abstract.drive.robot import Odometry, RobotStateError
from mbf_abstract.events import Event
from mbf_abstract.geometry import Command, Path, Pose
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.sensing import RangeScan
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.ticker import Ticker
from mbf_ros.messages import maps, sensors
from mbf_ros.messages.geometry import (
    MessageContext,
    command_twist,
    odometry_message,
    path_message,
    pose_stamped,
    transforms_message,
    twist,
    twist_stamped,
)
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.actionlib import ActionlibServer
from mbf_ros.rosbridge.map_topics import MapTopics
from mbf_ros.rosbridge.navigation import NODE
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge.topics import TopicTable

STATUS_PERIOD = 1.0  # s between two lists of actionlib, and two looks at the maps
MAX_EVENTS = 1000
FLAT = 0.02  # m; a scan that leaves its plane by more is no LaserScan


class Publisher:
    """Publishes the state of a session.

    Parameters
    ----------
    session : NavigationSession
    topics : TopicTable
    context : MessageContext
    post : callable
        Has a function called on the event loop of the topics.
    actionlib : ActionlibServer
        Gets its turn to send statuses.
    simulated : bool
        Publish tf, odometry and scans too, which else come from the robot.
    stamped_commands : bool
        Publish ``/cmd_vel`` as TwistStamped.
    period : float
        Time between two looks at the state [s].
    """

    def __init__(
        self,
        session: NavigationSession,
        topics: TopicTable,
        context: MessageContext,
        post: Callable[..., None],
        actionlib: ActionlibServer,
        simulated: bool,
        stamped_commands: bool = False,
        period: float = 0.05,
    ) -> None:
        self._session, self._server = session, session.navigator.server
        self._topics, self._context, self._post, self._actionlib = topics, context, post, actionlib
        self._simulated, self._stamped_commands = simulated, stamped_commands
        self._scans: dict[str, RangeScan] = {}
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._plan: Path | None = None
        self._shown_plan: Path | None = None
        self._goal: Pose | None = None
        self._static: list[Transform] = []
        self._stamps: dict[str, float] = {}
        self._sensor_frames: dict[str, Transform] = {}
        self._next_status = 0.0
        self._maps = MapTopics(self._server, topics, context)
        self._add_topics()
        self._server.get_path.listeners.append(self._take_plan)
        self._server.scan_listeners.append(self._take_scan)
        session.events.add_sink(self)
        self._ticker = Ticker(session.clock, session.events, self._tick, period, "rosbridge publisher")

    def close(self) -> None:
        """Publish no more."""
        self._ticker.stop()
        self._session.events.remove_sink(self)
        self._server.get_path.listeners.remove(self._take_plan)
        self._server.scan_listeners.remove(self._take_scan)

    def write(self, event: Event) -> None:
        """Keep an event until the next look; the oldest are dropped."""
        self._events.append(event)

    def send_command(self, command: Command) -> None:
        """Publish a command at once, for a robot that listens to ``/cmd_vel``; never waits."""
        value, now = command_twist(command), self._session.clock.now()
        frame_id = self._server.runtime.robot.robot_frame
        message = twist_stamped(value, frame_id, now, self._context) if self._stamped_commands else twist(value)
        self._send("/cmd_vel", message)

    # -------------------------------------------------------------------------------------------------------
    def _add_topics(self) -> None:
        add = self._topics.add_output
        add("/cmd_vel", "geometry_msgs/TwistStamped" if self._stamped_commands else "geometry_msgs/Twist")
        add("/plan", "nav_msgs/Path", latched=True)
        add(f"{NODE}/current_goal", "geometry_msgs/PoseStamped", latched=True)
        add(f"{NODE}/events", "std_msgs/String", depth=MAX_EVENTS)
        add(f"{NODE}/vector_field", "visualization_msgs/MarkerArray")
        if self._simulated:
            add("/tf", "tf2_msgs/TFMessage")
            add("/tf_static", "tf2_msgs/TFMessage", latched=True)
            add("/odom", "nav_msgs/Odometry")
            add("/scan", "sensor_msgs/LaserScan")
            add("/points", "sensor_msgs/PointCloud2")

    def _tick(self) -> None:
        if self._simulated:
            self._publish_transforms()
            self._publish_odometry()
            self._publish_scans()
            self.send_command(self._server.runtime.gate.last_command)
        self._publish_plan()
        self._publish_goal()
        self._publish_events()
        now = self._session.clock.now()
        if now >= self._next_status:
            self._next_status = now + STATUS_PERIOD
            self._post(self._actionlib.send_status)
            for topic, message in self._maps.changed(now):
                self._send(topic, message)

    def _send(self, topic: str, message: Message) -> None:
        if self._topics.is_wanted(topic):
            self._post(self._topics.send, topic, frame("publish", topic=topic, msg=message))

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

    def _take_plan(self, handle: AnyGoalHandle) -> None:
        if handle.result is not None and handle.result.path is not None:
            self._plan = handle.result.path

    def _publish_plan(self) -> None:
        if self._plan is not self._shown_plan and self._plan is not None:
            self._shown_plan = self._plan
            self._send("/plan", path_message(self._plan, self._context))
            field = f"{NODE}/vector_field"
            view = self._server.field_view(self._plan) if self._topics.is_wanted(field) else None
            if view is not None:
                self._send(field, maps.field_markers(view, self._plan.frame_id, self._plan.stamp, self._context))

    def _publish_goal(self) -> None:
        unfinished = self._server.move_base.unfinished
        goal = unfinished[-1].goal.target_pose if unfinished else None
        if goal is not None and goal is not self._goal:
            self._send(f"{NODE}/current_goal", pose_stamped(goal, self._context))
        self._goal = goal

    def _publish_events(self) -> None:
        while self._events:
            event = self._events.popleft()
            self._send(f"{NODE}/events", {"data": event.to_json()})
