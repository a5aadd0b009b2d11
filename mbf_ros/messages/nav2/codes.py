"""Error codes of Nav2 (Kilted) for our outcomes: the same failure, named as clients of Nav2 know it.

Nav2 numbers its failures by action, and its navigators pass on the codes of planners and controllers, as ours do. The
codes are constants of the result messages of nav2_msgs; 0 is that of a success.
"""

from __future__ import annotations

from enum import IntEnum

from mbf_abstract.outcomes import (
    ExePathOutcome,
    GetPathOutcome,
    MoveBaseOutcome,
    RecoveryOutcome,
    RefinePathOutcome,
    is_success,
)

FollowPathCode = IntEnum(
    "FollowPathCode",
    "UNKNOWN INVALID_CONTROLLER TF_ERROR INVALID_PATH PATIENCE_EXCEEDED "
    "FAILED_TO_MAKE_PROGRESS NO_VALID_CONTROL CONTROLLER_TIMED_OUT",
    start=100,
)
PlanningCode = IntEnum(
    "PlanningCode",
    "UNKNOWN INVALID_PLANNER TF_ERROR START_OUTSIDE_MAP GOAL_OUTSIDE_MAP "
    "START_OCCUPIED GOAL_OCCUPIED TIMEOUT NO_VALID_PATH",
    start=200,
)
ThroughPosesCode = IntEnum(
    "ThroughPosesCode",
    "UNKNOWN INVALID_PLANNER TF_ERROR START_OUTSIDE_MAP GOAL_OUTSIDE_MAP "
    "START_OCCUPIED GOAL_OCCUPIED TIMEOUT NO_VALID_PATH NO_VIAPOINTS_GIVEN",
    start=300,
)
SmoothingCode = IntEnum(
    "SmoothingCode",
    "UNKNOWN INVALID_SMOOTHER TIMEOUT SMOOTHED_PATH_IN_COLLISION FAILED_TO_SMOOTH_PATH INVALID_PATH",
    start=500,
)
WaypointsCode = IntEnum(
    "WaypointsCode", "UNKNOWN TASK_EXECUTOR_FAILED NO_VALID_WAYPOINTS STOP_ON_MISSED_WAYPOINT", start=600
)
SpinCode = IntEnum("SpinCode", "UNKNOWN TIMEOUT TF_ERROR COLLISION_AHEAD", start=700)
BackUpCode = IntEnum("BackUpCode", "UNKNOWN TIMEOUT TF_ERROR INVALID_INPUT COLLISION_AHEAD", start=710)
DriveOnHeadingCode = IntEnum("DriveOnHeadingCode", "UNKNOWN TIMEOUT TF_ERROR COLLISION_AHEAD INVALID_INPUT", start=720)
WaitCode = IntEnum("WaitCode", "UNKNOWN TIMEOUT", start=740)
NavigateCode = IntEnum("NavigateCode", "UNKNOWN FAILED_TO_LOAD_BEHAVIOR_TREE TF_ERROR TIMEOUT", start=9000)
NavigateThroughPosesCode = IntEnum(
    "NavigateThroughPosesCode", "UNKNOWN FAILED_TO_LOAD_BEHAVIOR_TREE TF_ERROR TIMEOUT", start=9100
)
WaypointState = IntEnum("WaypointState", "PENDING COMPLETED SKIPPED FAILED", start=0)

PLANNING: dict[int, PlanningCode] = {
    GetPathOutcome.INVALID_PLUGIN: PlanningCode.INVALID_PLANNER,
    GetPathOutcome.TF_ERROR: PlanningCode.TF_ERROR,
    GetPathOutcome.INVALID_START: PlanningCode.START_OUTSIDE_MAP,
    GetPathOutcome.OUT_OF_MAP: PlanningCode.GOAL_OUTSIDE_MAP,
    GetPathOutcome.BLOCKED_START: PlanningCode.START_OCCUPIED,
    GetPathOutcome.BLOCKED_GOAL: PlanningCode.GOAL_OCCUPIED,
    GetPathOutcome.PAT_EXCEEDED: PlanningCode.TIMEOUT,
    GetPathOutcome.NO_PATH_FOUND: PlanningCode.NO_VALID_PATH,
    GetPathOutcome.EMPTY_PATH: PlanningCode.NO_VALID_PATH,
}
FOLLOWING: dict[int, FollowPathCode] = {
    ExePathOutcome.INVALID_PLUGIN: FollowPathCode.INVALID_CONTROLLER,
    ExePathOutcome.TF_ERROR: FollowPathCode.TF_ERROR,
    ExePathOutcome.INVALID_PATH: FollowPathCode.INVALID_PATH,
    ExePathOutcome.PAT_EXCEEDED: FollowPathCode.PATIENCE_EXCEEDED,
    ExePathOutcome.ROBOT_STUCK: FollowPathCode.FAILED_TO_MAKE_PROGRESS,
    ExePathOutcome.OSCILLATION: FollowPathCode.FAILED_TO_MAKE_PROGRESS,
    ExePathOutcome.NO_VALID_CMD: FollowPathCode.NO_VALID_CONTROL,
    ExePathOutcome.BLOCKED_PATH: FollowPathCode.NO_VALID_CONTROL,
    ExePathOutcome.BLOCKED_GOAL: FollowPathCode.NO_VALID_CONTROL,
    ExePathOutcome.COLLISION: FollowPathCode.NO_VALID_CONTROL,
}
NAVIGATING: dict[int, IntEnum] = {
    MoveBaseOutcome.TF_ERROR: NavigateCode.TF_ERROR,
    MoveBaseOutcome.OSCILLATION: FollowPathCode.FAILED_TO_MAKE_PROGRESS,
    MoveBaseOutcome.COLLISION: FollowPathCode.NO_VALID_CONTROL,
    MoveBaseOutcome.START_BLOCKED: PlanningCode.START_OCCUPIED,
    MoveBaseOutcome.GOAL_BLOCKED: PlanningCode.GOAL_OCCUPIED,
    **PLANNING,
    **FOLLOWING,
}
SMOOTHING: dict[int, SmoothingCode] = {
    RefinePathOutcome.INVALID_PLUGIN: SmoothingCode.INVALID_SMOOTHER,
    RefinePathOutcome.STOPPED: SmoothingCode.TIMEOUT,
    RefinePathOutcome.DEPLETED: SmoothingCode.FAILED_TO_SMOOTH_PATH,
    RefinePathOutcome.FAILURE: SmoothingCode.FAILED_TO_SMOOTH_PATH,
}
BEHAVING: dict[int, str] = {
    RecoveryOutcome.PAT_EXCEEDED: "TIMEOUT",
    RecoveryOutcome.TF_ERROR: "TF_ERROR",
    RecoveryOutcome.IMPASSABLE: "COLLISION_AHEAD",
    RecoveryOutcome.FAILURE: "INVALID_INPUT",  # what a goal asks for is beyond the parameters of the behaviour
}
"""Name of the code, which not all behaviours have."""


def planning_code(outcome: int) -> int:
    """Code of ComputePathToPose for an outcome of ``get_path``; 0 for success."""
    return 0 if is_success(outcome) else PLANNING.get(outcome, PlanningCode.UNKNOWN)


def through_poses_code(outcome: int) -> int:
    """Code of ComputePathThroughPoses for an outcome of ``get_path``; 0 for success."""
    return 0 if is_success(outcome) else ThroughPosesCode[PLANNING.get(outcome, PlanningCode.UNKNOWN).name]


def following_code(outcome: int) -> int:
    """Code of FollowPath for an outcome of ``exe_path``; 0 for success."""
    return 0 if is_success(outcome) else FOLLOWING.get(outcome, FollowPathCode.UNKNOWN)


def navigating_code(outcome: int) -> int:
    """Code of NavigateToPose for an outcome of ``move_base``, a planner's or a controller's too; 0 for success."""
    return 0 if is_success(outcome) else NAVIGATING.get(outcome, NavigateCode.UNKNOWN)


def navigating_through_poses_code(outcome: int) -> int:
    """Code of NavigateThroughPoses for the same outcomes; those of planners as of ComputePathThroughPoses."""
    code = navigating_code(outcome)
    if isinstance(code, PlanningCode):
        return ThroughPosesCode[code.name]
    return NavigateThroughPosesCode[code.name] if isinstance(code, NavigateCode) else code


def waypoints_code(outcome: int) -> int:
    """Code of FollowWaypoints for an outcome of a waypoint sequence; 0 for success."""
    return 0 if is_success(outcome) else WaypointsCode.UNKNOWN


def smoothing_code(outcome: int) -> int:
    """Code of SmoothPath for an outcome of ``refine_path``; 0 for success."""
    return 0 if is_success(outcome) else SMOOTHING.get(outcome, SmoothingCode.UNKNOWN)


def behavior_code(codes: type[IntEnum], outcome: int) -> int:
    """Code of Spin, BackUp, DriveOnHeading or Wait, whose codes these are, for an outcome of ``recovery``."""
    if is_success(outcome):
        return 0
    return codes.__members__.get(BEHAVING.get(outcome, ""), codes["UNKNOWN"])
