"""What a navigator publishes: its plan and goal, its maps, the robot's outline, diagnostics and events, by topic.

One thread of a publisher asks for what is new at a fixed rate and sends it. The control loop is not part of it and
never waits for it; where messages are made or sent slowly, the next ones are of a later state.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.events import Event
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.polyline import polyline_lengths
from mbf_abstract.geometry.transform import Transform
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.maps.view import FieldView
from mbf_abstract.server.map_server import MapServer
from mbf_abstract.session import NavigationSession
from mbf_abstract.time.clock import Clock
from mbf_ros.map_messages import Audience, Output, map_messages
from mbf_ros.messages import maps
from mbf_ros.messages.diagnostics import diagnostics
from mbf_ros.messages.geometry import MessageContext, initial_pose_message, path_message, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.robot_inputs import INITIAL_POSE, INITIAL_POSE_TYPE, Quality

MAX_EVENTS = 1000
LOOK_AHEAD = 3.0  # m of the path that are the local plan
ROBOT_PERIOD, DIAGNOSTICS_PERIOD = 0.1, 1.0  # s

PLAN = Output("plan", "nav_msgs/Path", Quality.LATCHED, depth=1, always=True)
GOAL = Output("~/current_goal", "geometry_msgs/PoseStamped", Quality.LATCHED, depth=1, always=True)
FIELDS: dict[Output, Callable[[FieldView, str, float, MessageContext], Message]] = {
    Output("~/vector_field", "visualization_msgs/MarkerArray", Quality.LATCHED, depth=1): maps.field_markers,
    Output("~/mesh_vector_field", "mesh_msgs/VectorFieldStamped", Quality.LATCHED, depth=1): maps.vector_field,
}
"""Directions of the newest plan: for RViz without plugins, and for that of mesh_tools."""
LOCAL_PLAN = Output("local_plan", "nav_msgs/Path")
FOOTPRINT = Output("~/footprint", "geometry_msgs/PolygonStamped")
DIAGNOSTICS = Output("/diagnostics", "diagnostic_msgs/DiagnosticArray", shared=True)
LOCALIZATION = Output(INITIAL_POSE, INITIAL_POSE_TYPE, shared=True)
"""Where an app says that the robot is, for a localisation on the robot's side."""
EVENTS = Output("~/events", "std_msgs/String", depth=MAX_EVENTS)


class NavigatorMessages:
    """Makes messages of what is new.

    Parameters
    ----------
    real_time : Clock
        By which the periods count.
    context : callable
        How stamps and frames relate to ours, now.
    audience : callable
        Who listens to a topic; called on the thread of the publisher.
    inputs : callable
        What is wrong with each topic that must come, empty for one that comes, by topic.
    map_period : float
        Least time [s] between two messages of a map.
    robot_localizes : bool
        Whether what localises the robot is on its side; then ``session.set_initial_pose`` leads there.

    Attributes
    ----------
    outputs : tuple of Output
    """

    def __init__(
        self,
        session: NavigationSession,
        real_time: Clock,
        context: Callable[[], MessageContext],
        audience: Callable[[str], Audience],
        inputs: Callable[[], Mapping[str, str]] = dict,
        map_period: float = 1.0,
        robot_localizes: bool = False,
    ) -> None:
        self._session, self._server = session, session.navigator.server
        self._real_time, self._context, self._audience, self._inputs = real_time, context, audience, inputs
        self._maps = map_messages(self._server, context, audience)
        own = (PLAN, GOAL, *FIELDS, LOCAL_PLAN, FOOTPRINT, DIAGNOSTICS, EVENTS)
        self.outputs: tuple[Output, ...] = (*own, *(output for one in self._maps for output in one.outputs))
        self._periodic = (
            (map_period, self._map_messages),
            (ROBOT_PERIOD, self._robot_messages),
            (DIAGNOSTICS_PERIOD, self._diagnostics),
        )
        self._due = [0.0] * len(self._periodic)
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._plan: Path | None = None
        self._shown_plan: Path | None = None
        self._shown_fields: dict[str, tuple[Path, int]] = {}  # the plan of each, and how many had begun to listen
        self._goal: Pose | None = None
        self._initial_poses: deque[Pose] = deque(maxlen=1)
        if robot_localizes:
            self.outputs += (LOCALIZATION,)
            session.on_initial_pose.append(self._initial_poses.append)
        self._server.get_path.listeners.append(self._take_plan)
        session.events.add_sink(self)

    def close(self) -> None:
        """Listen to the navigator no more."""
        self._session.events.remove_sink(self)
        if LOCALIZATION in self.outputs:
            self._session.on_initial_pose.remove(self._initial_poses.append)
        self._server.get_path.listeners.remove(self._take_plan)

    def write(self, event: Event) -> None:
        """Keep an event until the next look; the oldest are dropped."""
        self._events.append(event)

    def changes(self) -> Iterator[tuple[str, Message]]:
        """Yield topics and their messages."""
        yield from self._plan_messages()
        yield from self._goal_messages()
        yield from self._event_messages()
        while self._initial_poses:
            stamp = self._session.clock.now()
            yield LOCALIZATION.topic, initial_pose_message(self._initial_poses.popleft(), stamp, self._context())
        now = self._real_time.now()
        for i, (period, messages) in enumerate(self._periodic):
            if now >= self._due[i]:
                self._due[i] = now + period
                yield from messages(self._session.clock.now())

    # ---------------------------------------------------------------------------------------------------------
    def _is_wanted(self, output: Output) -> bool:
        return self._audience(output.topic).listeners > 0

    def _take_plan(self, handle: AnyGoalHandle) -> None:
        if handle.result is not None and handle.result.path is not None:
            self._plan = handle.result.path

    def _plan_messages(self) -> Iterator[tuple[str, Message]]:
        plan = self._plan
        if plan is None:
            return
        if plan is not self._shown_plan:
            self._shown_plan = plan
            yield PLAN.topic, path_message(plan, self._context())
        for output, message in FIELDS.items():
            audience = self._audience(output.topic)
            if audience.listeners and self._shown_fields.get(output.topic) != (plan, audience.joined):
                self._shown_fields[output.topic] = plan, audience.joined
                if (view := self._server.field_view(plan)) is not None:
                    yield output.topic, message(view, plan.frame_id, plan.stamp, self._context())

    def _goal_messages(self) -> Iterator[tuple[str, Message]]:
        unfinished = self._server.move_base.unfinished
        goal = unfinished[-1].goal.target_pose if unfinished else None
        if goal is not None and goal is not self._goal:
            yield GOAL.topic, pose_stamped(goal, self._context())
        self._goal = goal

    def _event_messages(self) -> Iterator[tuple[str, Message]]:
        is_wanted = self._is_wanted(EVENTS)
        while self._events:
            event = self._events.popleft()
            if is_wanted:
                yield EVENTS.topic, {"data": event.to_json()}

    def _map_messages(self, now: float) -> Iterator[tuple[str, Message]]:
        for one in self._maps:
            yield from one.changes(now)

    def _robot_messages(self, now: float) -> Iterator[tuple[str, Message]]:
        """The outline of the robot where it is, and the path that lies ahead of it."""
        if self._is_wanted(FOOTPRINT) and isinstance(self._server, MapServer):
            robot = self._server.runtime.robot
            outline = self._server.local_map.map.robot_outline
            try:
                pose = robot.pose()
            except RobotStateError:
                pose = None
            if pose is not None and len(outline):
                corners = np.column_stack([outline, np.zeros(len(outline))])
                placed = Transform.from_pose(pose, robot.robot_frame).apply(corners)
                yield FOOTPRINT.topic, maps.polygon(placed, pose.frame_id, pose.stamp, self._context())
        running = self._server.exe_path.unfinished if self._is_wanted(LOCAL_PLAN) else []
        for handle in running[-1:]:
            if (feedback := handle.feedback) is not None:
                ahead = path_ahead(handle.goal.path, feedback.distance_along_path, LOOK_AHEAD)
                yield LOCAL_PLAN.topic, path_message(ahead, self._context())

    def _diagnostics(self, now: float) -> Iterator[tuple[str, Message]]:
        if self._is_wanted(DIAGNOSTICS):
            yield DIAGNOSTICS.topic, diagnostics(self._server, self._inputs(), now, self._context())


def path_ahead(path: Path, remaining: float, distance: float) -> Path:
    """Return the poses of a path between ``remaining`` [m] before its end and ``distance`` [m] on, both along it.

    The pose before the first of these and the one behind the last belong to it, so a robot between two poses has both.
    """
    lengths = polyline_lengths(path.positions)
    begin = float(lengths[-1]) - remaining
    first = max(int(np.searchsorted(lengths, begin, side="right")) - 1, 0)
    last = min(int(np.searchsorted(lengths, begin + distance)), len(lengths) - 1)
    assert path.orientations is not None
    return Path(path.positions[first : last + 1], path.orientations[first : last + 1], path.frame_id, path.stamp)
