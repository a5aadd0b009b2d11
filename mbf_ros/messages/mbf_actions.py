"""The four actions of mbf_msgs: goals, results and feedback, to messages and back.

Their outcome codes are ours. What a message has no field for is not left out silently: making the message of such a
goal raises MessageError. A result or a feedback that comes back from a message has none of our additional fields.
"""

from __future__ import annotations

import math
from typing import Any

from mbf_abstract.goals.goal_types import (
    ExePathFeedback,
    ExePathGoal,
    ExePathResult,
    GetPathGoal,
    GetPathResult,
    MoveBaseGoal,
    MoveBaseResult,
    RecoveryGoal,
    RecoveryResultMessage,
)
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_ros.messages.action_mapping import ActionMapping, path_or_refuse, pose_or_refuse
from mbf_ros.messages.geometry import (
    MessageContext,
    command_twist,
    optional_pose_of,
    path_message,
    path_of,
    pose_of,
    pose_stamped,
    twist_of,
    twist_stamped,
)
from mbf_ros.messages.interfaces import Message, MessageError


def _refuse_unsaid(kind: str, **fields: object) -> None:
    """Raise where a goal has a value that the message cannot carry."""
    for name, value in fields.items():
        if value:
            raise MessageError(f"{kind} has no field for {name}, which is {value!r}")


# ------------------------------------------------------------------------------------------------------- get_path
def get_path_goal(goal: GetPathGoal, context: MessageContext) -> Message:
    """Return a GetPath_Goal; raises MessageError where it cannot carry the goal."""
    kind = "mbf_msgs/action/GetPath"
    _refuse_unsaid(kind, via=goal.via, goal_area=goal.goal_area, angle_tolerance=goal.angle_tolerance)
    if goal.dist_tolerance is None:
        raise MessageError(f"{kind} needs a tolerance: it cannot ask for the server's (dist_tolerance None)")
    return {
        "use_start_pose": goal.start_pose is not None,
        "start_pose": pose_stamped(goal.start_pose, context),
        "target_pose": pose_stamped(goal.target_pose, context),
        "tolerance": goal.dist_tolerance,
        "planner": goal.planner,
        "concurrency_slot": goal.concurrency_slot,
    }


def get_path_goal_of(message: Message, context: MessageContext) -> GetPathGoal:
    """Return the goal of a GetPath_Goal; raises RefusedGoal with INVALID_GOAL or INVALID_START."""
    has_start = message["use_start_pose"]
    return GetPathGoal(
        target_pose=pose_or_refuse(message, context, "target_pose", GetPathOutcome.INVALID_GOAL),
        start_pose=pose_or_refuse(message, context, "start_pose", GetPathOutcome.INVALID_START) if has_start else None,
        planner=message["planner"],
        dist_tolerance=message["tolerance"],
        concurrency_slot=message["concurrency_slot"],
    )


def get_path_result(result: GetPathResult, context: MessageContext) -> Message:
    """Return a GetPath_Result; its path has no poses where there is no path."""
    path = path_message(result.path, context)
    return {"outcome": result.outcome, "message": result.message, "path": path, "cost": result.cost}


def get_path_result_of(message: Message, context: MessageContext) -> GetPathResult:
    """Return the result of a GetPath_Result."""
    path = path_of(message["path"], context) if message["path"]["poses"] else None
    return GetPathResult(message["outcome"], message["message"], path, message["cost"])


# ------------------------------------------------------------------------------------------------------- exe_path
def exe_path_goal(goal: ExePathGoal, context: MessageContext) -> Message:
    """Return an ExePath_Goal; raises MessageError where it cannot carry the goal."""
    kind, tolerances = "mbf_msgs/action/ExePath", (goal.dist_tolerance, goal.angle_tolerance)
    _refuse_unsaid(kind, goal_area=goal.goal_area)
    if (tolerances[0] is None) != (tolerances[1] is None):
        raise MessageError(f"{kind} has both tolerances or none, got dist_tolerance and angle_tolerance {tolerances}")
    return {
        "path": path_message(goal.path, context),
        "controller": goal.controller,
        "concurrency_slot": goal.concurrency_slot,
        "tolerance_from_action": tolerances[0] is not None,
        "dist_tolerance": tolerances[0] or 0.0,
        "angle_tolerance": tolerances[1] or 0.0,
    }


def exe_path_goal_of(message: Message, context: MessageContext) -> ExePathGoal:
    """Return the goal of an ExePath_Goal; raises RefusedGoal with INVALID_PATH."""
    own = message["tolerance_from_action"]
    return ExePathGoal(
        path=path_or_refuse(message, context, ExePathOutcome.INVALID_PATH),
        controller=message["controller"],
        dist_tolerance=message["dist_tolerance"] if own else None,
        angle_tolerance=message["angle_tolerance"] if own else None,
        concurrency_slot=message["concurrency_slot"],
    )


def driving_result(result: ExePathResult | MoveBaseResult, context: MessageContext) -> Message:
    """Return an ExePath_Result or a MoveBase_Result."""
    return {
        "outcome": result.outcome,
        "message": result.message,
        "dist_to_goal": result.dist_to_goal,
        "angle_to_goal": result.angle_to_goal,
        "final_pose": pose_stamped(result.final_pose, context),
    }


def _driving_fields(message: Message, context: MessageContext) -> dict[str, Any]:
    return {
        "outcome": message["outcome"],
        "message": message["message"],
        "final_pose": optional_pose_of(message["final_pose"], context),
        "dist_to_goal": _or_infinite(message["dist_to_goal"]),
        "angle_to_goal": _or_infinite(message["angle_to_goal"]),
    }


def _or_infinite(number: float) -> float:
    """Infinity where JSON had null for it."""
    return math.inf if math.isnan(number) else number


def exe_path_result_of(message: Message, context: MessageContext) -> ExePathResult:
    """Return the result of an ExePath_Result."""
    return ExePathResult(**_driving_fields(message, context))


def driving_feedback(feedback: ExePathFeedback, context: MessageContext) -> Message:
    """Return an ExePath_Feedback or a MoveBase_Feedback; a command of a car as in ``command_twist``."""
    command, pose = command_twist(feedback.last_command), feedback.current_pose
    return {
        "outcome": feedback.outcome,
        "message": feedback.message,
        "dist_to_goal": feedback.dist_to_goal,
        "angle_to_goal": feedback.angle_to_goal,
        "current_pose": pose_stamped(pose, context),
        "last_cmd_vel": twist_stamped(command, "base_link", pose.stamp, context),
    }


def driving_feedback_of(message: Message, context: MessageContext) -> ExePathFeedback:
    """Return the feedback of an ExePath_Feedback or a MoveBase_Feedback."""
    return ExePathFeedback(
        outcome=message["outcome"],
        message=message["message"],
        current_pose=pose_of(message["current_pose"], context),
        dist_to_goal=_or_infinite(message["dist_to_goal"]),
        angle_to_goal=_or_infinite(message["angle_to_goal"]),
        distance_along_path=math.nan,
        time_to_goal=math.inf,
        last_command=twist_of(message["last_cmd_vel"]["twist"]),
    )


# ----------------------------------------------------------------------------------------------- recovery, move_base
def recovery_goal(goal: RecoveryGoal, context: MessageContext) -> Message:
    """Return a Recovery_Goal."""
    return {"behavior": goal.behavior, "concurrency_slot": goal.concurrency_slot}


def recovery_goal_of(message: Message, context: MessageContext) -> RecoveryGoal:
    """Return the goal of a Recovery_Goal."""
    return RecoveryGoal(message["behavior"], message["concurrency_slot"])


def recovery_result(result: RecoveryResultMessage, context: MessageContext) -> Message:
    """Return a Recovery_Result."""
    return {"outcome": result.outcome, "message": result.message, "used_plugin": result.used_plugin}


def recovery_result_of(message: Message, context: MessageContext) -> RecoveryResultMessage:
    """Return the result of a Recovery_Result."""
    return RecoveryResultMessage(message["outcome"], message["message"], message["used_plugin"])


def move_base_goal(goal: MoveBaseGoal, context: MessageContext) -> Message:
    """Return a MoveBase_Goal; raises MessageError where it cannot carry the goal."""
    tolerances = {"dist_tolerance": goal.dist_tolerance, "angle_tolerance": goal.angle_tolerance}
    _refuse_unsaid("mbf_msgs/action/MoveBase", via=goal.via, goal_area=goal.goal_area, **tolerances)
    if goal.recovery_behaviors == ():
        raise MessageError("mbf_msgs/action/MoveBase cannot ask for no recovery at all: an empty list means all")
    return {
        "target_pose": pose_stamped(goal.target_pose, context),
        "controller": goal.controller,
        "planner": goal.planner,
        "recovery_behaviors": list(goal.recovery_behaviors or ()),
    }


def move_base_goal_of(message: Message, context: MessageContext) -> MoveBaseGoal:
    """Return the goal of a MoveBase_Goal; raises RefusedGoal with INVALID_GOAL."""
    return MoveBaseGoal(
        target_pose=pose_or_refuse(message, context, "target_pose", GetPathOutcome.INVALID_GOAL),
        planner=message["planner"],
        controller=message["controller"],
        recovery_behaviors=tuple(message["recovery_behaviors"]) or None,
    )


def move_base_result_of(message: Message, context: MessageContext) -> MoveBaseResult:
    """Return the result of a MoveBase_Result."""
    return MoveBaseResult(**_driving_fields(message, context))


GET_PATH = ActionMapping("mbf_msgs/action/GetPath", get_path_goal_of, get_path_result, None, GetPathResult)
EXE_PATH = ActionMapping("mbf_msgs/action/ExePath", exe_path_goal_of, driving_result, driving_feedback, ExePathResult)
RECOVERY = ActionMapping("mbf_msgs/action/Recovery", recovery_goal_of, recovery_result, None, RecoveryResultMessage)
MOVE_BASE = ActionMapping(
    "mbf_msgs/action/MoveBase", move_base_goal_of, driving_result, driving_feedback, MoveBaseResult
)
