"""What the navigator publishes: commands, plans, maps, events, and for a simulated robot also its tf, odometry, scans.

One thread reads the state at a fixed rate and makes the messages that somebody listens to, each once for all of them.
The control loop is not part of it and never waits for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from mbf_abstract.events import Event
from mbf_abstract.geometry import Command, Path, Pose
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.ticker import Ticker
from mbf_ros.messages import maps
from mbf_ros.messages.geometry import (
    MessageContext,
    command_twist,
    path_message,
    pose_stamped,
    twist,
    twist_stamped,
)
from mbf_ros.messages.interfaces import Message
from mbf_ros.rosbridge.actionlib import ActionlibServer
from mbf_ros.rosbridge.map_topics import MapTopics
from mbf_ros.rosbridge.navigation import NODE
from mbf_ros.rosbridge.protocol import frame
from mbf_ros.rosbridge.topics import TopicTable
from mbf_ros.rosbridge_robot.robot_state import RobotState

STATUS_PERIOD = 1.0  # s between two lists of actionlib, and two looks at the maps
MAX_EVENTS = 1000


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
        self._stamped_commands = stamped_commands
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._plan: Path | None = None
        self._shown_plan: Path | None = None
        self._goal: Pose | None = None
        self._next_status = 0.0
        self._maps = MapTopics(self._server, topics, context)
        self._add_topics()
        self._robot_state = RobotState(session, topics, context, self._send) if simulated else None
        self._server.get_path.listeners.append(self._take_plan)
        session.events.add_sink(self)
        self._ticker = Ticker(session.clock, session.events, self._tick, period, "rosbridge publisher")

    def close(self) -> None:
        """Publish no more."""
        self._ticker.stop()
        self._session.events.remove_sink(self)
        self._server.get_path.listeners.remove(self._take_plan)
        if self._robot_state is not None:
            self._robot_state.close()

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

    def _tick(self) -> None:
        if self._robot_state is not None:
            self._robot_state.publish()
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
