"""FollowWaypoints and NavigateThroughPoses of nav2_msgs, which are both sequences of ``move_base`` goals of ours.

So the robot stops at each pose of NavigateThroughPoses, which Nav2 drives through; see decision 0032.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.goal_types import (
    FollowWaypointsFeedback,
    FollowWaypointsGoal,
    FollowWaypointsResult,
    MoveBaseResult,
)
from mbf_abstract.outcomes import GetPathOutcome, MoveBaseOutcome
from mbf_ros.messages import nav2_codes as codes
from mbf_ros.messages.action_mapping import ActionMapping, RefusedGoal
from mbf_ros.messages.geometry import MessageContext, duration, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2_actions import GoalsMapping, error_msg, navigate_feedback, poses_or_refuse, unsupported


def _waypoints_goal_of(message: Message, context: MessageContext) -> FollowWaypointsGoal:
    """Nav2 counts the loops after the first one, and begins the first at ``goal_index``."""
    code = codes.WaypointsCode.NO_VALID_WAYPOINTS
    poses = poses_or_refuse(message["poses"], context, "poses", error_code=code)
    first, more = message.get("goal_index", 0), message.get("number_of_loops", 0)
    if first and more:
        text = f"goal_index {first} together with number_of_loops {more} is not supported here"
        raise RefusedGoal(MoveBaseOutcome.FAILURE, text)
    if not poses[first:]:
        raise RefusedGoal(
            GetPathOutcome.INVALID_GOAL, f"poses: there is none from goal_index {first} on", error_code=code
        )
    return FollowWaypointsGoal(poses[first:], loops=more + 1, stop_on_failure=False)


def _waypoint_status(state: codes.WaypointState, index: int, pose: Pose | None, context: MessageContext) -> Message:
    return {
        "waypoint_status": int(state),
        "waypoint_index": index,
        "waypoint_pose": pose_stamped(pose, context),
        "error_code": 0,
        "error_msg": "",
    }


def _missed_waypoints(
    result: FollowWaypointsResult, waypoint: Callable[[int], tuple[int, Pose | None]], context: MessageContext
) -> list[Message]:
    """The visits that failed; ``waypoint`` gives index and pose in the client's list by the number of a visit."""
    missed = []
    for visit in result.failed:
        status = _waypoint_status(codes.WaypointState.FAILED, *waypoint(visit), context)
        code, text = codes.navigating_code(result.results[visit].outcome), error_msg(result.results[visit])
        missed.append({**status, "error_code": code, "error_msg": text})
    return missed


def _waypoints_result(result: FollowWaypointsResult, context: MessageContext) -> Message:
    missed = _missed_waypoints(result, lambda visit: (visit, None), context)
    code = codes.waypoints_code(result.outcome)
    return {"missed_waypoints": missed, "error_code": code, "error_msg": error_msg(result)}


def _waypoints_feedback(feedback: FollowWaypointsFeedback, context: MessageContext) -> Message:
    return {"current_waypoint": feedback.waypoint}


def waypoints_of_client(
    goal: FollowWaypointsGoal,
    first: int,
    shown: FollowWaypointsFeedback | FollowWaypointsResult,
    context: MessageContext,
) -> Message:
    """Return the fields of a feedback or result that have a place in the client's list.

    Parameters
    ----------
    goal : FollowWaypointsGoal
        Ours.
    first : int
        The ``goal_index`` of the client's, where ours begins.
    shown : FollowWaypointsFeedback or FollowWaypointsResult
    context : MessageContext
    """
    count = len(goal.waypoints)

    def in_list(visit: int) -> tuple[int, Pose]:
        return first + visit % count, goal.waypoints[visit % count]

    if isinstance(shown, FollowWaypointsFeedback):
        return {"current_waypoint": first + shown.waypoint}
    missed = _missed_waypoints(shown, in_list, context)
    return {  # index and goal as in Jazzy
        "missed_waypoints": [{**one, "index": one["waypoint_index"], "goal": one["waypoint_pose"]} for one in missed]
    }


# ----------------------------------------------------------------------------------------------- through poses
def _through_goal_of(message: Message, context: MessageContext) -> FollowWaypointsGoal:
    """Each pose is a waypoint, and the first that cannot be reached ends the goal."""
    code = codes.NavigateThroughPosesCode.FAILED_TO_LOAD_BEHAVIOR_TREE
    unsupported(message, MoveBaseOutcome.FAILURE, "behavior_tree", error_code=code)
    poses = poses_or_refuse(message["poses"], context, "poses")
    if not poses:
        raise RefusedGoal(GetPathOutcome.INVALID_GOAL, "poses: there is none")
    return FollowWaypointsGoal(poses)


def _through_result(result: FollowWaypointsResult, context: MessageContext) -> Message:
    return {
        "error_code": codes.navigating_through_poses_code(result.outcome),
        "error_msg": error_msg(result),
        "waypoint_statuses": [],
    }


def _through_feedback(feedback: FollowWaypointsFeedback, context: MessageContext) -> Message:
    """Feedback of the present leg; there must be one."""
    assert feedback.driving is not None
    leg = navigate_feedback(feedback.driving, context)
    return {**leg, "number_of_poses_remaining": 0, "waypoint_statuses": []}


def waypoint_statuses(
    goal: FollowWaypointsGoal, results: Sequence[MoveBaseResult], context: MessageContext
) -> list[Message]:
    """Return a nav2_msgs/WaypointStatus of each pose of a goal, of which ``results`` are the visits that have ended."""
    states = [codes.WaypointState.COMPLETED if one.success else codes.WaypointState.FAILED for one in results]
    states += [codes.WaypointState.PENDING] * (len(goal.waypoints) - len(states))
    statuses = [
        _waypoint_status(state, visit, pose, context)
        for visit, (state, pose) in enumerate(zip(states, goal.waypoints, strict=True))
    ]
    for status, result in zip(statuses, results, strict=False):
        code = codes.navigating_through_poses_code(result.outcome)
        status.update(error_code=code, error_msg=error_msg(result))
    return statuses


def through_poses_progress(
    goal: FollowWaypointsGoal, shown: FollowWaypointsFeedback | FollowWaypointsResult
) -> Message:
    """Return what is left of the whole way: the leg that is driven, if any, then straight from pose to pose."""
    driving = shown.driving if isinstance(shown, FollowWaypointsFeedback) else None
    done = len(shown.results)
    if driving is None:
        return {
            "distance_remaining": _straight(goal.waypoints[max(done - 1, 0) :]),
            "number_of_poses_remaining": len(goal.waypoints) - done,
        }
    rest = goal.waypoints[done:]
    whole = driving.distance_along_path + _straight(rest)
    share = whole / driving.distance_along_path if driving.distance_along_path > 0.0 else 1.0
    return {
        "distance_remaining": whole,
        "estimated_time_remaining": duration(driving.time_to_goal * share),
        "number_of_poses_remaining": len(rest),
    }


def _straight(poses: Sequence[Pose]) -> float:
    """Length [m] of the lines from pose to pose; those between two frames do not count."""
    return sum(one.distance_to(other) for one, other in pairwise(poses) if one.frame_id == other.frame_id)


NAVIGATE_THROUGH_POSES = GoalsMapping(
    "nav2_msgs/action/NavigateThroughPoses",
    _through_goal_of,
    _through_result,
    _through_feedback,
    FollowWaypointsResult,
    field="poses",
)
FOLLOW_WAYPOINTS = ActionMapping(
    "nav2_msgs/action/FollowWaypoints",
    _waypoints_goal_of,
    _waypoints_result,
    _waypoints_feedback,
    FollowWaypointsResult,
)
