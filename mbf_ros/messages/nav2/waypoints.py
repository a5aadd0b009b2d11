"""FollowWaypoints and NavigateThroughPoses of nav2_msgs.

The first is a sequence of ``move_base`` goals, at each of which the robot stops; the other is one goal with via poses,
which it drives through.
"""

from __future__ import annotations

from collections.abc import Callable

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.feedback_types import FollowWaypointsFeedback, MoveBaseFeedback
from mbf_abstract.goals.goal_types import FollowWaypointsGoal, MoveBaseGoal
from mbf_abstract.goals.result_types import FollowWaypointsResult, MoveBaseResult
from mbf_abstract.outcomes import GetPathOutcome, MoveBaseOutcome
from mbf_ros.messages.action_mapping import ActionMapping, RefusedGoal
from mbf_ros.messages.geometry import MessageContext, pose_stamped
from mbf_ros.messages.interfaces import Message
from mbf_ros.messages.nav2 import codes
from mbf_ros.messages.nav2.actions import GoalsMapping, error_msg, navigate_feedback, poses_or_refuse, unsupported


def _waypoints_goal_of(message: Message, context: MessageContext) -> FollowWaypointsGoal:
    """Nav2 counts the loops after the first one, and begins the first at ``goal_index``."""
    code = codes.WaypointsCode.NO_VALID_WAYPOINTS
    poses = poses_or_refuse(message["poses"], context, "poses", error_code=code)
    first, more = message.get("goal_index", 0), message.get("number_of_loops", 0)
    if first and more:
        text = f"goal_index {first} together with number_of_loops {more} is not supported here"
        raise RefusedGoal(MoveBaseOutcome.FAILURE, text)
    if not poses[first:]:
        text = f"goal_index: expected one below the number of poses ({len(poses)}), got {first}"
        text = text if poses else "poses: expected at least one pose, got none"
        raise RefusedGoal(GetPathOutcome.INVALID_GOAL, text, error_code=code)
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
def _through_goal_of(message: Message, context: MessageContext) -> MoveBaseGoal:
    """The last pose is the target, and the others lie on the way."""
    code = codes.NavigateThroughPosesCode.FAILED_TO_LOAD_BEHAVIOR_TREE
    unsupported(message, MoveBaseOutcome.FAILURE, "behavior_tree", error_code=code)
    poses = poses_or_refuse(message["poses"], context, "poses")
    if not poses:
        raise RefusedGoal(GetPathOutcome.INVALID_GOAL, "poses: expected at least one pose, got none")
    return MoveBaseGoal(poses[-1], via=poses[:-1])


def _through_result(result: MoveBaseResult, context: MessageContext) -> Message:
    return {
        "error_code": codes.navigating_through_poses_code(result.outcome),
        "error_msg": error_msg(result),
        "waypoint_statuses": [],
    }


def _through_feedback(feedback: MoveBaseFeedback, context: MessageContext) -> Message:
    """Distance and time are those of the whole way that is left; the target is one of the poses."""
    fields = navigate_feedback(feedback, context)
    return {**fields, "number_of_poses_remaining": feedback.via_left + 1, "waypoint_statuses": []}


def waypoint_statuses(
    goal: MoveBaseGoal, feedback: MoveBaseFeedback | None, result: MoveBaseResult | None, context: MessageContext
) -> list[Message]:
    """Return a nav2_msgs/WaypointStatus of each pose of a goal.

    Parameters
    ----------
    feedback : MoveBaseFeedback, optional
        The newest one; None where the robot has not set out.
    result : MoveBaseResult, optional
        None while the goal runs. Where it failed, the pose that the robot was on its way to is the one that it missed.
    """
    poses = (*goal.via, goal.target_pose)
    passed = len(goal.via) - feedback.via_left if feedback is not None else 0
    states = [codes.WaypointState.COMPLETED] * (len(poses) if result is not None and result.success else passed)
    states += [codes.WaypointState.PENDING] * (len(poses) - len(states))
    missed: Message = {}
    if result is not None and not result.success:
        states[passed] = codes.WaypointState.FAILED
        missed = {"error_code": codes.navigating_through_poses_code(result.outcome), "error_msg": error_msg(result)}
    return [
        {**_waypoint_status(state, index, pose, context), **(missed if state is codes.WaypointState.FAILED else {})}
        for index, (state, pose) in enumerate(zip(states, poses, strict=True))
    ]


NAVIGATE_THROUGH_POSES = GoalsMapping(
    "nav2_msgs/action/NavigateThroughPoses",
    _through_goal_of,
    _through_result,
    _through_feedback,
    MoveBaseResult,
    field="poses",
)
FOLLOW_WAYPOINTS = ActionMapping(
    "nav2_msgs/action/FollowWaypoints",
    _waypoints_goal_of,
    _waypoints_result,
    _waypoints_feedback,
    FollowWaypointsResult,
)
