"""Feedback of the actions while they run; the fields are those of ``mbf_msgs``."""

from __future__ import annotations

from dataclasses import dataclass

from mbf_abstract.geometry import Command, Pose
from mbf_abstract.goals.result_types import MoveBaseResult


@dataclass(frozen=True)
class ExePathFeedback:
    """One observed control cycle.

    Attributes
    ----------
    outcome, message
        Of the last controller call, also of a failed one that is being retried.
    dist_to_goal, angle_to_goal : float
        Straight distance [m] and rotation [rad] to the last pose of the path.
    distance_along_path : float
        Distance to go along the path [m].
    time_to_goal : float
        ``distance_along_path`` at the mean speed since the robot set off [s]; infinite until it has come 5 cm.
    last_command : Command, optional
        What the plugin computed, also where something else was sent.
    """

    outcome: int
    message: str
    current_pose: Pose
    dist_to_goal: float
    angle_to_goal: float
    distance_along_path: float
    time_to_goal: float
    last_command: Command | None = None


@dataclass(frozen=True)
class MoveBaseFeedback(ExePathFeedback):
    """The same of a robot on its way to a pose, whose path leads through all via poses that are left.

    Attributes
    ----------
    via_left : int
        How many via poses the robot has not passed yet.
    """

    via_left: int = 0


@dataclass(frozen=True)
class FollowWaypointsFeedback:
    """Progress of a waypoint sequence.

    Attributes
    ----------
    visit, waypoint : int
        The present visit, counted from 0 over all loops, and the index of its pose.
    results : tuple of MoveBaseResult
        The visits that have ended.
    driving : ExePathFeedback, optional
        Feedback of the present visit; None when it has just ended.
    """

    visit: int
    waypoint: int
    results: tuple[MoveBaseResult, ...]
    driving: ExePathFeedback | None


@dataclass(frozen=True)
class NoFeedback:
    """Feedback of the actions that have none; never published."""
