"""Actions of nav2_msgs: goals of their clients to ours, our results and feedback to theirs.

Fields are those of Kilted. Those of Jazzy are taken too: there a list of poses stands where Kilted has nav_msgs/Goals,
and some fields are missing. What ours cannot respect, a behaviour tree or a goal checker, is refused where it is
named, and not ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RefinePathGoal
from mbf_abstract.goals.result_types import ActionResult, ExePathResult, GetPathResult, MoveBaseResult, RefinePathResult
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RefinePathOutcome
from mbf_ros.messages.action_mapping import ActionMapping, G, R, RefusedGoal, path_or_refuse, pose_or_refuse
from mbf_ros.messages.commands import command_twist
from mbf_ros.messages.geometry import MessageContext, duration, path_message, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2 import codes


@dataclass(frozen=True)
class GoalsMapping(ActionMapping[G, R]):
    """An action with a list of poses, which has become a message of its own with Kilted; ``field`` is its name."""

    field: str = "goals"

    def goal(self, values: object, context: MessageContext) -> G:
        """Return our goal of the values of a client, see ``ActionMapping``."""
        if isinstance(values, Mapping) and isinstance(values.get(self.field), list | tuple):
            values = {**values, self.field: {"goals": values[self.field]}}
        return super().goal(values, context)


def unsupported(message: Message, outcome: int, *names: str, **fields: int) -> None:
    """Raise RefusedGoal where one of the fields has a value; not all distributions have all fields.

    ``fields`` are those of its result.
    """
    for name in names:
        if value := message.get(name):
            raise RefusedGoal(outcome, f"{name} {value!r} is not supported here; leave it empty", **fields)


def poses_or_refuse(message: Any, context: MessageContext, name: str, **fields: int) -> tuple[Pose, ...]:
    """Return the poses of a list, or of a nav_msgs/Goals; raises RefusedGoal with INVALID_GOAL where one is none.

    ``fields`` are those of its result.
    """
    outcome = GetPathOutcome.INVALID_GOAL
    messages: list[Message] = message["goals"] if isinstance(message, Mapping) else message
    named = {f"{name}[{i}]": one for i, one in enumerate(messages)}
    return tuple(pose_or_refuse(named, context, each, outcome, **fields) for each in named)


# ------------------------------------------------------------------------------------------------------- planning
def _start(message: Message, context: MessageContext) -> Pose | None:
    return pose_or_refuse(message, context, "start", GetPathOutcome.INVALID_START) if message["use_start"] else None


def _path_goal_of(message: Message, context: MessageContext) -> GetPathGoal:
    target = pose_or_refuse(message, context, "goal", GetPathOutcome.INVALID_GOAL)
    return GetPathGoal(target, _start(message, context), message["planner_id"])


def _via_goal_of(message: Message, context: MessageContext) -> GetPathGoal:
    poses = poses_or_refuse(message["goals"], context, "goals")
    if not poses:
        code = codes.ThroughPosesCode.NO_VIAPOINTS_GIVEN
        raise RefusedGoal(GetPathOutcome.INVALID_GOAL, "goals: expected at least one pose, got none", error_code=code)
    return GetPathGoal(poses[-1], _start(message, context), message["planner_id"], via=poses[:-1])


def _path_result(result: GetPathResult, context: MessageContext, through: bool) -> Message:
    code = codes.through_poses_code if through else codes.planning_code
    return {
        "path": path_message(result.path, context),
        "planning_time": duration(0.0),
        "error_code": code(result.outcome),
        "error_msg": error_msg(result),
    }


def error_msg(result: ActionResult) -> str:
    """What clients of Nav2 read of a failure; empty for a success."""
    return "" if result.success else f"{result.outcome_name}: {result.message}"


# ------------------------------------------------------------------------------------------------------- driving
def _follow_goal_of(message: Message, context: MessageContext) -> ExePathGoal:
    unsupported(message, ExePathOutcome.INVALID_PLUGIN, "goal_checker_id", "progress_checker_id")
    return ExePathGoal(path_or_refuse(message, context, ExePathOutcome.INVALID_PATH), message["controller_id"])


def _follow_result(result: ExePathResult, context: MessageContext) -> Message:
    return {"result": {}, "error_code": codes.following_code(result.outcome), "error_msg": error_msg(result)}


def _follow_feedback(feedback: ExePathFeedback, context: MessageContext) -> Message:
    speed = command_twist(feedback.last_command).speed
    return {"distance_to_goal": feedback.distance_along_path, "speed": speed}


def _navigate_goal_of(message: Message, context: MessageContext) -> MoveBaseGoal:
    code = codes.NavigateCode.FAILED_TO_LOAD_BEHAVIOR_TREE
    unsupported(message, MoveBaseOutcome.FAILURE, "behavior_tree", error_code=code)
    return MoveBaseGoal(pose_or_refuse(message, context, "pose", GetPathOutcome.INVALID_GOAL))


def _navigate_result(result: MoveBaseResult, context: MessageContext) -> Message:
    return {"error_code": codes.navigating_code(result.outcome), "error_msg": error_msg(result)}


def navigate_feedback(feedback: ExePathFeedback, context: MessageContext) -> Message:
    """Return a NavigateToPose_Feedback; what the goal has behind it is not in ours."""
    return {
        "current_pose": pose_stamped(feedback.current_pose, context),
        "navigation_time": duration(0.0),
        "estimated_time_remaining": duration(feedback.time_to_goal),
        "number_of_recoveries": 0,
        "distance_remaining": feedback.distance_along_path,
    }


# ------------------------------------------------------------------------------------------------------ smoothing
def _smooth_goal_of(message: Message, context: MessageContext) -> RefinePathGoal:
    unsupported(message, RefinePathOutcome.FAILURE, "check_for_collisions")
    code = codes.SmoothingCode.INVALID_PATH
    path = path_or_refuse(message, context, RefinePathOutcome.FAILURE, error_code=code)
    if len(path) == 0:
        raise RefusedGoal(RefinePathOutcome.FAILURE, "path: expected at least one pose, got none", error_code=code)
    return RefinePathGoal(path, message["smoother_id"])


def _smooth_result(result: RefinePathResult, context: MessageContext) -> Message:
    return {
        "path": path_message(result.refined_path, context),
        "smoothing_duration": duration(0.0),
        "was_completed": result.success,
        "error_code": codes.smoothing_code(result.outcome),
        "error_msg": error_msg(result),
    }


COMPUTE_PATH_TO_POSE = ActionMapping(
    "nav2_msgs/action/ComputePathToPose", _path_goal_of, partial(_path_result, through=False), None, GetPathResult
)
COMPUTE_PATH_THROUGH_POSES = GoalsMapping(
    "nav2_msgs/action/ComputePathThroughPoses", _via_goal_of, partial(_path_result, through=True), None, GetPathResult
)
FOLLOW_PATH = ActionMapping(
    "nav2_msgs/action/FollowPath", _follow_goal_of, _follow_result, _follow_feedback, ExePathResult
)
NAVIGATE_TO_POSE = ActionMapping(
    "nav2_msgs/action/NavigateToPose", _navigate_goal_of, _navigate_result, navigate_feedback, MoveBaseResult
)
SMOOTH_PATH = ActionMapping("nav2_msgs/action/SmoothPath", _smooth_goal_of, _smooth_result, None, RefinePathResult)
