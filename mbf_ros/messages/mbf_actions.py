"""The four actions of mbf_msgs: goals of messages, and the messages of results and feedback.

Their outcome codes are ours. Fields of ours that a message has no place for are left out.
"""

from __future__ import annotations

from mbf_abstract.goals.feedback_types import ExePathFeedback
from mbf_abstract.goals.goal_types import ExePathGoal, GetPathGoal, MoveBaseGoal, RecoveryGoal
from mbf_abstract.goals.result_types import ExePathResult, GetPathResult, MoveBaseResult, RecoveryResultMessage
from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome
from mbf_ros.messages.action_mapping import ActionMapping, path_or_refuse, pose_or_refuse
from mbf_ros.messages.commands import command_message
from mbf_ros.messages.geometry import MessageContext, path_message, pose_stamped
from mbf_ros.messages.interfaces import Message


# ------------------------------------------------------------------------------------------------------- get_path
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


# ------------------------------------------------------------------------------------------------------- exe_path
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


def driving_feedback(feedback: ExePathFeedback, context: MessageContext) -> Message:
    """Return an ExePath_Feedback or a MoveBase_Feedback; a command of a car as in ``command_twist``."""
    command, pose = feedback.last_command, feedback.current_pose
    return {
        "outcome": feedback.outcome,
        "message": feedback.message,
        "dist_to_goal": feedback.dist_to_goal,
        "angle_to_goal": feedback.angle_to_goal,
        "current_pose": pose_stamped(pose, context),
        "last_cmd_vel": command_message(command, True, "base_link", pose.stamp, context),
    }


# ----------------------------------------------------------------------------------------------- recovery, move_base
def recovery_goal_of(message: Message, context: MessageContext) -> RecoveryGoal:
    """Return the goal of a Recovery_Goal."""
    return RecoveryGoal(message["behavior"], message["concurrency_slot"])


def recovery_result(result: RecoveryResultMessage, context: MessageContext) -> Message:
    """Return a Recovery_Result."""
    return {"outcome": result.outcome, "message": result.message, "used_plugin": result.used_plugin}


def move_base_goal_of(message: Message, context: MessageContext) -> MoveBaseGoal:
    """Return the goal of a MoveBase_Goal; raises RefusedGoal with INVALID_GOAL."""
    return MoveBaseGoal(
        target_pose=pose_or_refuse(message, context, "target_pose", GetPathOutcome.INVALID_GOAL),
        planner=message["planner"],
        controller=message["controller"],
        recovery_behaviors=tuple(message["recovery_behaviors"]) or None,
    )


GET_PATH = ActionMapping("mbf_msgs/action/GetPath", get_path_goal_of, get_path_result, None, GetPathResult)
EXE_PATH = ActionMapping("mbf_msgs/action/ExePath", exe_path_goal_of, driving_result, driving_feedback, ExePathResult)
RECOVERY = ActionMapping("mbf_msgs/action/Recovery", recovery_goal_of, recovery_result, None, RecoveryResultMessage)
MOVE_BASE = ActionMapping(
    "mbf_msgs/action/MoveBase", move_base_goal_of, driving_result, driving_feedback, MoveBaseResult
)
