"""Actions of nav2_msgs: goals of their clients to ours, our results and feedback to theirs.

Fields are those of Kilted. A list of poses of Humble and Jazzy, where Kilted has nav_msgs/Goals, is taken too; their
clients do not look for the fields of results that came later. What ours cannot respect, a behaviour tree or a goal
checker, is refused where it is named, and not ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import (
    ExePathFeedback,
    ExePathGoal,
    ExePathResult,
    FollowWaypointsFeedback,
    FollowWaypointsGoal,
    FollowWaypointsResult,
    GetPathGoal,
    GetPathResult,
    MoveBaseGoal,
    MoveBaseResult,
    RefinePathGoal,
    RefinePathResult,
)
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, RefinePathOutcome
from mbf_ros.messages import nav2_codes as codes
from mbf_ros.messages.action_mapping import ActionMapping, RefusedGoal, path_or_refuse, pose_or_refuse
from mbf_ros.messages.geometry import MessageContext, command_twist, duration, path_message, pose_stamped
from mbf_ros.messages.interfaces import Message, MessageError

MISSED = 2  # nav2_msgs/WaypointStatus.FAILED


@dataclass(frozen=True)
class ThroughPosesMapping(ActionMapping[GetPathGoal, GetPathResult]):
    """ComputePathThroughPoses, whose list of poses has become a message of its own with Kilted."""

    def goal(self, values: object, context: MessageContext) -> GetPathGoal:
        """Return our goal of the values of a client, see ``ActionMapping``."""
        if isinstance(values, Mapping) and isinstance(values.get("goals"), list | tuple):
            values = {**values, "goals": {"goals": values["goals"]}}
        return super().goal(values, context)


def _unsupported(message: Message, *names: str) -> None:
    for name in names:
        if message[name]:
            raise MessageError(f"{name} {message[name]!r} is not supported here; leave it empty")


def _poses(messages: list[Message], context: MessageContext, name: str) -> tuple[Pose, ...]:
    outcome = GetPathOutcome.INVALID_GOAL
    named = {f"{name}[{i}]": one for i, one in enumerate(messages)}
    return tuple(pose_or_refuse(named, context, each, outcome) for each in named)


# ------------------------------------------------------------------------------------------------------- planning
def _start(message: Message, context: MessageContext) -> Pose | None:
    return pose_or_refuse(message, context, "start", GetPathOutcome.INVALID_START) if message["use_start"] else None


def _path_goal_of(message: Message, context: MessageContext) -> GetPathGoal:
    target = pose_or_refuse(message, context, "goal", GetPathOutcome.INVALID_GOAL)
    return GetPathGoal(target, _start(message, context), message["planner_id"])


def _via_goal_of(message: Message, context: MessageContext) -> GetPathGoal:
    poses = _poses(message["goals"]["goals"], context, "goals")
    if not poses:
        raise RefusedGoal(GetPathOutcome.INVALID_GOAL, "goals: there is no pose to go to")
    return GetPathGoal(poses[-1], _start(message, context), message["planner_id"], via=poses[:-1])


def _path_result(result: GetPathResult, context: MessageContext, through: bool) -> Message:
    code = codes.through_poses_code if through else codes.planning_code
    return {
        "path": path_message(result.path, context),
        "planning_time": duration(0.0),
        "error_code": code(result.outcome),
        "error_msg": _text(result),
    }


def _text(result: Any) -> str:
    return "" if result.success else f"{result.outcome_name}: {result.message}"


# ------------------------------------------------------------------------------------------------------- driving
def _follow_goal_of(message: Message, context: MessageContext) -> ExePathGoal:
    _unsupported(message, "goal_checker_id", "progress_checker_id")
    return ExePathGoal(path_or_refuse(message, context, ExePathOutcome.INVALID_PATH), message["controller_id"])


def _follow_result(result: ExePathResult, context: MessageContext) -> Message:
    return {"result": {}, "error_code": codes.following_code(result.outcome), "error_msg": _text(result)}


def _follow_feedback(feedback: ExePathFeedback, context: MessageContext) -> Message:
    speed = command_twist(feedback.last_command).speed
    return {"distance_to_goal": feedback.distance_along_path, "speed": speed}


def _navigate_goal_of(message: Message, context: MessageContext) -> MoveBaseGoal:
    _unsupported(message, "behavior_tree")
    return MoveBaseGoal(pose_or_refuse(message, context, "pose", GetPathOutcome.INVALID_GOAL))


def _navigate_result(result: MoveBaseResult, context: MessageContext) -> Message:
    return {"error_code": codes.navigating_code(result.outcome), "error_msg": _text(result)}


def _navigate_feedback(feedback: ExePathFeedback, context: MessageContext) -> Message:
    return {
        "current_pose": pose_stamped(feedback.current_pose, context),
        "navigation_time": duration(0.0),
        "estimated_time_remaining": duration(feedback.time_to_goal),
        "number_of_recoveries": 0,
        "distance_remaining": feedback.distance_along_path,
    }


# ----------------------------------------------------------------------------------------------------- waypoints
def _waypoints_goal_of(message: Message, context: MessageContext) -> FollowWaypointsGoal:
    """Nav2 counts the loops after the first one, and begins the first at ``goal_index``."""
    poses, first, more = _poses(message["poses"], context, "poses"), message["goal_index"], message["number_of_loops"]
    if first and more:
        raise MessageError(f"goal_index {first} together with number_of_loops {more} is not supported here")
    if not poses[first:]:
        raise RefusedGoal(GetPathOutcome.INVALID_GOAL, f"poses: there is none from goal_index {first} on")
    return FollowWaypointsGoal(poses[first:], loops=more + 1, stop_on_failure=False)


def _waypoints_result(result: FollowWaypointsResult, context: MessageContext) -> Message:
    missed = [
        {
            "waypoint_status": MISSED,
            "waypoint_index": visit,
            "waypoint_pose": pose_stamped(None, context),
            "error_code": codes.navigating_code(result.results[visit].outcome),
            "error_msg": _text(result.results[visit]),
        }
        for visit in result.failed
    ]
    code = codes.waypoints_code(result.outcome)
    return {"missed_waypoints": missed, "error_code": code, "error_msg": _text(result)}


def _waypoints_feedback(feedback: FollowWaypointsFeedback, context: MessageContext) -> Message:
    return {"current_waypoint": feedback.waypoint}


# ------------------------------------------------------------------------------------------------------ smoothing
def _smooth_goal_of(message: Message, context: MessageContext) -> RefinePathGoal:
    path = path_or_refuse(message, context, RefinePathOutcome.FAILURE)
    return RefinePathGoal(path, message["smoother_id"])


def _smooth_result(result: RefinePathResult, context: MessageContext) -> Message:
    return {
        "path": path_message(result.refined_path, context),
        "smoothing_duration": duration(0.0),
        "was_completed": result.success,
        "error_code": codes.smoothing_code(result.outcome),
        "error_msg": _text(result),
    }


COMPUTE_PATH_TO_POSE = ActionMapping(
    "nav2_msgs/action/ComputePathToPose", _path_goal_of, partial(_path_result, through=False), None, GetPathResult
)
COMPUTE_PATH_THROUGH_POSES = ThroughPosesMapping(
    "nav2_msgs/action/ComputePathThroughPoses", _via_goal_of, partial(_path_result, through=True), None, GetPathResult
)
FOLLOW_PATH = ActionMapping(
    "nav2_msgs/action/FollowPath", _follow_goal_of, _follow_result, _follow_feedback, ExePathResult
)
NAVIGATE_TO_POSE = ActionMapping(
    "nav2_msgs/action/NavigateToPose", _navigate_goal_of, _navigate_result, _navigate_feedback, MoveBaseResult
)
FOLLOW_WAYPOINTS = ActionMapping(
    "nav2_msgs/action/FollowWaypoints",
    _waypoints_goal_of,
    _waypoints_result,
    _waypoints_feedback,
    FollowWaypointsResult,
)
SMOOTH_PATH = ActionMapping("nav2_msgs/action/SmoothPath", _smooth_goal_of, _smooth_result, None, RefinePathResult)
