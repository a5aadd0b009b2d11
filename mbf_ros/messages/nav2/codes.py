"""Error codes of Nav2 (Kilted) for our outcomes: the same failure, named as clients of Nav2 know it.

Nav2 numbers its failures by action, and its navigators pass on the codes of planners and controllers, as ours do. The
codes are constants of the result messages of nav2_msgs.
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


class FollowPathCode(IntEnum):
    """Of FollowPath."""

    NONE = 0
    UNKNOWN = 100
    INVALID_CONTROLLER = 101
    TF_ERROR = 102
    INVALID_PATH = 103
    PATIENCE_EXCEEDED = 104
    FAILED_TO_MAKE_PROGRESS = 105
    NO_VALID_CONTROL = 106
    CONTROLLER_TIMED_OUT = 107


class PlanningCode(IntEnum):
    """Of ComputePathToPose."""

    NONE = 0
    UNKNOWN = 200
    INVALID_PLANNER = 201
    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    TIMEOUT = 207
    NO_VALID_PATH = 208


class ThroughPosesCode(IntEnum):
    """Of ComputePathThroughPoses."""

    NONE = 0
    UNKNOWN = 300
    INVALID_PLANNER = 301
    TF_ERROR = 302
    START_OUTSIDE_MAP = 303
    GOAL_OUTSIDE_MAP = 304
    START_OCCUPIED = 305
    GOAL_OCCUPIED = 306
    TIMEOUT = 307
    NO_VALID_PATH = 308
    NO_VIAPOINTS_GIVEN = 309


class SmoothingCode(IntEnum):
    """Of SmoothPath."""

    NONE = 0
    UNKNOWN = 500
    INVALID_SMOOTHER = 501
    TIMEOUT = 502
    SMOOTHED_PATH_IN_COLLISION = 503
    FAILED_TO_SMOOTH_PATH = 504
    INVALID_PATH = 505


class WaypointsCode(IntEnum):
    """Of FollowWaypoints."""

    NONE = 0
    UNKNOWN = 600
    TASK_EXECUTOR_FAILED = 601
    NO_VALID_WAYPOINTS = 602
    STOP_ON_MISSED_WAYPOINT = 603


class SpinCode(IntEnum):
    """Of Spin."""

    NONE = 0
    UNKNOWN = 700
    TIMEOUT = 701
    TF_ERROR = 702
    COLLISION_AHEAD = 703


class BackUpCode(IntEnum):
    """Of BackUp."""

    NONE = 0
    UNKNOWN = 710
    TIMEOUT = 711
    TF_ERROR = 712
    INVALID_INPUT = 713
    COLLISION_AHEAD = 714


class DriveOnHeadingCode(IntEnum):
    """Of DriveOnHeading."""

    NONE = 0
    UNKNOWN = 720
    TIMEOUT = 721
    TF_ERROR = 722
    COLLISION_AHEAD = 723
    INVALID_INPUT = 724


class WaitCode(IntEnum):
    """Of Wait."""

    NONE = 0
    UNKNOWN = 740
    TIMEOUT = 741


class NavigateCode(IntEnum):
    """Of NavigateToPose."""

    NONE = 0
    UNKNOWN = 9000
    FAILED_TO_LOAD_BEHAVIOR_TREE = 9001
    TF_ERROR = 9002
    TIMEOUT = 9003


class NavigateThroughPosesCode(IntEnum):
    """Of NavigateThroughPoses."""

    NONE = 0
    UNKNOWN = 9100
    FAILED_TO_LOAD_BEHAVIOR_TREE = 9101
    TF_ERROR = 9102
    TIMEOUT = 9103


class WaypointState(IntEnum):
    """Of nav2_msgs/WaypointStatus."""

    PENDING = 0
    COMPLETED = 1
    SKIPPED = 2
    FAILED = 3


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
