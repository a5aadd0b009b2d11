"""Error codes of Nav2 (Kilted) for our outcomes: the same failure, named as clients of Nav2 know it.

Nav2 numbers its failures by action, and its navigators pass on the codes of planners and controllers, as ours do.
"""

from __future__ import annotations

from mbf_abstract.outcomes import ExePathOutcome, GetPathOutcome, MoveBaseOutcome, RefinePathOutcome, is_success

UNKNOWN_PLANNING, UNKNOWN_THROUGH_POSES, UNKNOWN_FOLLOWING = 200, 300, 100
UNKNOWN_SMOOTHING, UNKNOWN_WAYPOINTS, UNKNOWN_NAVIGATING = 500, 600, 9000

PLANNING: dict[int, int] = {
    GetPathOutcome.INVALID_PLUGIN: 201,  # INVALID_PLANNER
    GetPathOutcome.TF_ERROR: 202,
    GetPathOutcome.INVALID_START: 203,  # START_OUTSIDE_MAP
    GetPathOutcome.OUT_OF_MAP: 204,  # GOAL_OUTSIDE_MAP
    GetPathOutcome.BLOCKED_START: 205,  # START_OCCUPIED
    GetPathOutcome.BLOCKED_GOAL: 206,  # GOAL_OCCUPIED
    GetPathOutcome.PAT_EXCEEDED: 207,  # TIMEOUT
    GetPathOutcome.NO_PATH_FOUND: 208,  # NO_VALID_PATH
    GetPathOutcome.EMPTY_PATH: 208,
}
FOLLOWING: dict[int, int] = {
    ExePathOutcome.INVALID_PLUGIN: 101,  # INVALID_CONTROLLER
    ExePathOutcome.TF_ERROR: 102,
    ExePathOutcome.INVALID_PATH: 103,
    ExePathOutcome.PAT_EXCEEDED: 104,  # PATIENCE_EXCEEDED
    ExePathOutcome.ROBOT_STUCK: 105,  # FAILED_TO_MAKE_PROGRESS
    ExePathOutcome.OSCILLATION: 105,
    ExePathOutcome.NO_VALID_CMD: 106,  # NO_VALID_CONTROL
    ExePathOutcome.BLOCKED_PATH: 106,
    ExePathOutcome.BLOCKED_GOAL: 106,
    ExePathOutcome.COLLISION: 106,
}
NAVIGATING: dict[int, int] = {
    MoveBaseOutcome.TF_ERROR: 9002,
    MoveBaseOutcome.OSCILLATION: 105,
    MoveBaseOutcome.COLLISION: 106,
    MoveBaseOutcome.START_BLOCKED: 205,
    MoveBaseOutcome.GOAL_BLOCKED: 206,
}
SMOOTHING: dict[int, int] = {
    RefinePathOutcome.DEPLETED: 502,  # TIMEOUT
    RefinePathOutcome.FAILURE: 504,  # FAILED_TO_SMOOTH_PATH
}


def planning_code(outcome: int) -> int:
    """Code of ComputePathToPose for an outcome of ``get_path``; 0 for success."""
    return 0 if is_success(outcome) else PLANNING.get(outcome, UNKNOWN_PLANNING)


def through_poses_code(outcome: int) -> int:
    """Code of ComputePathThroughPoses for an outcome of ``get_path``; 0 for success."""
    code = planning_code(outcome)
    return code + (UNKNOWN_THROUGH_POSES - UNKNOWN_PLANNING) if code else 0


def following_code(outcome: int) -> int:
    """Code of FollowPath for an outcome of ``exe_path``; 0 for success."""
    return 0 if is_success(outcome) else FOLLOWING.get(outcome, UNKNOWN_FOLLOWING)


def navigating_code(outcome: int) -> int:
    """Code of NavigateToPose for an outcome of ``move_base``, a planner's or a controller's too; 0 for success."""
    if is_success(outcome):
        return 0
    return next((codes[outcome] for codes in (NAVIGATING, PLANNING, FOLLOWING) if outcome in codes), UNKNOWN_NAVIGATING)


def waypoints_code(outcome: int) -> int:
    """Code of FollowWaypoints for an outcome of a waypoint sequence; 0 for success."""
    return 0 if is_success(outcome) else UNKNOWN_WAYPOINTS


def smoothing_code(outcome: int) -> int:
    """Code of SmoothPath for an outcome of ``refine_path``; 0 for success."""
    return 0 if is_success(outcome) else SMOOTHING.get(outcome, UNKNOWN_SMOOTHING)
