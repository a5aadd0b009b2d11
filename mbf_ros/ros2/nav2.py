"""Nav2's names on the node, so that its clients, such as the ``BasicNavigator``, run against ours.

They are offered where nav2_msgs is installed. The node then stands for Nav2's servers: actions and services have their
names, and ``get_state`` of each of them answers ``active`` once goals are taken. What localises the robot is not ours:
``amcl`` is answered for only where that is asked for, see ``NodeOptions.stands_for_amcl``.
"""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from typing import Any

from mbf_abstract.actions.sub_goals import SUB_GOAL_SLOT
from mbf_abstract.drive.robot import RobotStateError
from mbf_abstract.geometry import Pose, normalize_angle
from mbf_abstract.goals.feedback_types import FollowWaypointsFeedback, MoveBaseFeedback
from mbf_abstract.goals.goal_types import RecoveryGoal
from mbf_abstract.goals.handle import AnyGoalHandle
from mbf_abstract.goals.result_types import FollowWaypointsResult, MoveBaseResult
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RecoveryOutcome, RefinePathOutcome
from mbf_abstract.server.navigation_server import AbstractNavigationServer
from mbf_abstract.time.clock import Clock
from mbf_ros.messages.action_mapping import ActionMapping
from mbf_ros.messages.geometry import duration, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2 import actions as nav2_actions
from mbf_ros.messages.nav2 import waypoints as nav2_waypoints
from mbf_ros.messages.nav2.behaviors import BEHAVIORS, behavior_mappings
from mbf_ros.ros2.actions import More, Outcomes, ServedAction, Serving
from mbf_ros.ros2.conversion import fill
from mbf_ros.ros2.running import RosError

ACTIONS: dict[str, tuple[ActionMapping[Any, Any], Outcomes]] = {
    "compute_path_to_pose": (nav2_actions.COMPUTE_PATH_TO_POSE, GetPathOutcome),
    "compute_path_through_poses": (nav2_actions.COMPUTE_PATH_THROUGH_POSES, GetPathOutcome),
    "follow_path": (nav2_actions.FOLLOW_PATH, ExePathOutcome),
    "smooth_path": (nav2_actions.SMOOTH_PATH, RefinePathOutcome),
    "navigate_to_pose": (nav2_actions.NAVIGATE_TO_POSE, MoveBaseOutcome),
    "navigate_through_poses": (nav2_waypoints.NAVIGATE_THROUGH_POSES, MoveBaseOutcome),
    "follow_waypoints": (nav2_waypoints.FOLLOW_WAYPOINTS, MoveBaseOutcome),
}
"""Mapping and outcomes by the names of the actions, without the behaviours."""
TIMES = ("navigation_time", "planning_time", "smoothing_duration", "total_elapsed_time")
"""Fields of feedback or result that say how long the goal has taken."""
DISCOVERY_TIME = 3.0  # s of real time in which a node that starts gets to know the others
DISCOVERY_PERIOD = 0.1  # s between two looks at them
FEEDBACK_PERIOD = 0.1  # s of real time between two messages about a behaviour


def is_offered(choice: bool | None) -> bool:
    """Whether Nav2's names are offered: as chosen, with None where nav2_msgs is installed."""
    return find_spec("nav2_msgs") is not None if choice is None else choice


def offers_names(node: Any, choice: bool | None, clock: Clock) -> bool:
    """Whether a node is to offer Nav2's names, where no other node has them; waits until others would be known.

    Parameters
    ----------
    choice : bool, optional
        As of ``is_offered``.
    clock : Clock
        Real time since the node was made.

    Raises
    ------
    RosError
        They are chosen, and another node serves actions of these names.
    """
    if not is_offered(choice):
        return False
    while not (found := served_by_others(node)) and clock.now() < DISCOVERY_TIME:
        clock.sleep(DISCOVERY_PERIOD)
    if not found:
        return True
    text = f"another node serves {', '.join(found)} already"
    if choice:
        raise RosError(f"Nav2's names cannot be offered: {text}; end that node, or leave out --nav2 and --amcl")
    node.get_logger().warning(f"Nav2's names are left out: {text}")
    return False


def served_by_others(node: Any) -> list[str]:
    """Names of Nav2's actions that are served; of a node that does not serve them yet.

    Who publishes the feedback of an action serves it, whereas services are also listed where they are only asked for.
    """
    names = (*ACTIONS, *BEHAVIORS)
    return [name for name in names if node.get_publishers_info_by_topic(f"{name}/_action/feedback")]


def serve_actions(node: Any, server: AbstractNavigationServer, serving: Serving) -> list[ServedAction]:
    """Offer Nav2's actions on a node."""
    recoveries = RecoveryCount(server)
    behaviors = behavior_mappings(server.plugins)
    own: dict[str, type[Nav2Action]] = {
        "navigate_through_poses": ThroughPosesAction,
        "follow_waypoints": WaypointsAction,
        **dict.fromkeys(behaviors, BehaviorAction),
    }
    actions = {**ACTIONS, **{name: (mapping, RecoveryOutcome) for name, mapping in behaviors.items()}}
    return [
        own.get(name, Nav2Action)(server, recoveries, node, name, *action, serving) for name, action in actions.items()
    ]


class RecoveryCount:
    """How many recoveries that ``move_base`` has begun have ended.

    Attributes
    ----------
    ended : int
    """

    def __init__(self, server: AbstractNavigationServer) -> None:
        self.ended = 0
        server.recovery.listeners.append(self._count)

    def _count(self, handle: AnyGoalHandle) -> None:
        self.ended += handle.goal.concurrency_slot == SUB_GOAL_SLOT


class Nav2Action(ServedAction):
    """An action of Nav2: its feedback and result also say how long the goal has taken, and what it has needed."""

    def __init__(self, server: AbstractNavigationServer, recoveries: RecoveryCount, *action: Any) -> None:
        self._server, self._recoveries = server, recoveries
        super().__init__(*action)

    def _observe(self, goal_handle: Any, handle: AnyGoalHandle) -> More:
        clock = self._server.runtime.clock
        began, recovered = clock.now(), self._recoveries.ended

        def more(shown: Any) -> Message:
            fields: Message = dict.fromkeys(TIMES, duration(clock.now() - began))
            return {**fields, "number_of_recoveries": self._recoveries.ended - recovered}

        return more

    def _show_last(self, goal_handle: Any, handle: AnyGoalHandle, more: More) -> None:
        """Publish the newest feedback, as a slow client has missed others."""
        if self._mapping.feedback is not None and handle.feedback is not None:
            self._publish_feedback(goal_handle, handle.feedback, more)


class ThroughPosesAction(Nav2Action):
    """NavigateThroughPoses, of which some fields need the goal."""

    def _observe(self, goal_handle: Any, handle: AnyGoalHandle) -> More:
        taken, goal = super()._observe(goal_handle, handle), handle.goal

        def more(shown: MoveBaseFeedback | MoveBaseResult) -> Message:
            newest, result = (handle.feedback, shown) if isinstance(shown, MoveBaseResult) else (shown, None)
            statuses = nav2_waypoints.waypoint_statuses(goal, newest, result, self._context())
            return {**taken(shown), "waypoint_statuses": statuses}

        return more

    def _show_last(self, goal_handle: Any, handle: AnyGoalHandle, more: More) -> None:
        """Publish where the robot is at the end, and what is left of the path: nothing for one that has arrived."""
        newest, result = handle.feedback, handle.result
        assert result is not None and self._mapping.feedback is not None
        with suppress(RobotStateError):
            pose = pose_stamped(self._server.runtime.robot.pose(), self._context())
            left = {"number_of_poses_remaining": 0 if result.success else len(handle.goal.via) + 1}
            if newest is not None and not result.success:
                left = self._mapping.feedback(newest, self._context())
            goal_handle.publish_feedback(fill(self._class.Feedback(), {**left, "current_pose": pose, **more(result)}))


class WaypointsAction(Nav2Action):
    """FollowWaypoints, whose waypoints are numbered as in the list of the client."""

    def _observe(self, goal_handle: Any, handle: AnyGoalHandle) -> More:
        taken, first = super()._observe(goal_handle, handle), getattr(goal_handle.request, "goal_index", 0)

        def more(shown: FollowWaypointsFeedback | FollowWaypointsResult) -> Message:
            fields = nav2_waypoints.waypoints_of_client(handle.goal, first, shown, self._context())
            return {**taken(shown), **fields}

        return more


class BehaviorAction(Nav2Action):
    """A behaviour of Nav2; as ours have no feedback, the robot is watched meanwhile."""

    def _observe(self, goal_handle: Any, handle: AnyGoalHandle) -> More:
        from rclpy.clock import Clock as RclpyClock
        from rclpy.clock import ClockType

        progress, taken = Progress(self._server, handle.goal), super()._observe(goal_handle, handle)

        def more(shown: Any) -> Message:
            return {**taken(shown), **progress.look()}

        def publish() -> None:
            if not handle.done:
                self._show_last(goal_handle, handle, more)

        timer = self._node.create_timer(FEEDBACK_PERIOD, publish, clock=RclpyClock(clock_type=ClockType.STEADY_TIME))
        executor = self._node.executor
        handle.add_done_callback(lambda done: executor.create_task(self._node.destroy_timer, timer))
        return more

    def _show_last(self, goal_handle: Any, handle: AnyGoalHandle, more: More) -> None:
        """Publish what the robot has done by now."""
        goal_handle.publish_feedback(fill(self._class.Feedback(), more(None)))


class Progress:
    """What a behaviour has done, as seen of the robot: path and turn since the start, and the rest of its time."""

    def __init__(self, server: AbstractNavigationServer, goal: RecoveryGoal) -> None:
        self._robot, self._clock = server.runtime.robot, server.runtime.clock
        self._end = self._clock.now() + goal.parameters.get("duration", 0.0)
        self._start: Pose | None = None
        self._last: Pose | None = None
        self._driven = self._turned = 0.0
        self.look()

    def look(self) -> Message:
        """Return the fields of feedback by now; without a pose of the robot those of the last one."""
        with suppress(RobotStateError):
            pose = self._robot.pose()
            start, last = self._start or pose, self._last or pose
            self._driven = start.distance_to(pose)
            self._turned += normalize_angle(pose.yaw - last.yaw)
            self._start, self._last = start, pose
        return {
            "distance_traveled": self._driven,
            "angular_distance_traveled": self._turned,
            "time_left": duration(max(self._end - self._clock.now(), 0.0)),
        }
