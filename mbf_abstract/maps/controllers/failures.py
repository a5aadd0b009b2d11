"""How controllers of every map report the same failure: one code and one text for it, whatever the map."""

from __future__ import annotations

import math

import numpy as np

from mbf_abstract.execution.path_tracker import PathTracker
from mbf_abstract.geometry import Pose, normalize_angle
from mbf_abstract.geometry.tangent_plane import storey_gap
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.queries import PADDED, CellState
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult


def obstacle_text(place: str) -> str:
    """Where the robot would touch an obstacle if it drove on, as the text of BLOCKED_PATH and of ``obstacle_ahead``."""
    return f"an obstacle is in the way: the robot would touch it at {place}"


def no_path() -> ControlResult:
    """Failure of a controller that has been given no path."""
    return ControlResult(ExePathOutcome.INVALID_PATH, "no path has been set")


def blocked_path(navigation_map: NavigationMap, pose: Pose, obstacle: str) -> ControlResult:
    """Failure of a controller that stops at ``pose``, in the frame of the map, before an ``obstacle``.

    A robot that touches something may move as long as it goes no deeper; where its path does, that is a COLLISION.
    """
    if touches(navigation_map, pose):
        return collision(f"its path leads farther into it: {obstacle}")
    return ControlResult(ExePathOutcome.BLOCKED_PATH, obstacle)


def no_motion(navigation_map: NavigationMap, pose: Pose, reason: str) -> ControlResult:
    """Failure of a controller at ``pose``, in the frame of the map, none of whose motions is free."""
    if touches(navigation_map, pose):
        return collision(f"no motion that was tried leads out of it: {reason}")
    return ControlResult(ExePathOutcome.NO_VALID_CMD, reason)


def touches(navigation_map: NavigationMap, pose: Pose) -> bool:
    """Whether the padded outline of the robot touches something lethal at a pose in the frame of the map."""
    answer = navigation_map.pose_check(PADDED)(pose)
    return CellState.LETHAL in (answer.state, answer.known)


def collision(reason: str) -> ControlResult:
    """Failure of a controller whose robot touches an obstacle and cannot get away as it would like."""
    return ControlResult(ExePathOutcome.COLLISION, f"the robot touches an obstacle where it stands, and {reason}")


def storeys_off(pose: Pose, tracker: PathTracker, navigation_map: NavigationMap) -> float:
    """How far [m] a path, tracked as seen from above, is above the robot where it has got to; 0 on its storey."""
    if navigation_map.same_storey == math.inf:
        return 0.0
    place = [np.interp(tracker.progress, tracker.lengths, column) for column in tracker.path.positions.T]
    return storey_gap(pose, np.array(place), navigation_map.same_storey)


def missed_path(tracker: PathTracker, allowed: float, above: float = 0.0) -> ControlResult | None:
    """Failure of a controller whose robot is farther than ``allowed`` [m] from its path; None if it is not.

    ``above`` [m] is how far the path is above the robot, in addition to what the tracker knows.
    """
    deviation = math.hypot(tracker.deviation, above)
    if deviation <= allowed:
        return None
    message = f"the robot is {deviation:.2f} m from the path, allowed are {allowed:g} m"
    return ControlResult(ExePathOutcome.MISSED_PATH, message)


def missed_goal(tracker: PathTracker, pose: Pose, allowed: float) -> ControlResult | None:
    """Failure of a controller whose robot has passed the end of its path and cannot turn back to it; else None.

    ``allowed`` [m] is how far beside the end it may be.
    """
    if tracker.remaining > 0.0 or tracker.length == 0.0 or tracker.deviation <= allowed:
        return None
    off = math.degrees(abs(normalize_angle(tracker.goal.yaw - pose.yaw)))
    message = f"the robot is {tracker.deviation:.2f} m past the end of its path, {off:.0f} degrees off its heading"
    return ControlResult(ExePathOutcome.MISSED_GOAL, message)


def stands(pose: Pose, seconds: float, reason: str = "") -> ControlResult:
    """Failure of a controller none of whose motions gets the robot on; ``reason`` is why its path itself does not."""
    text = f"no motion has got the robot on from ({pose.x:.2f}, {pose.y:.2f}) for {seconds:.1f} s"
    return ControlResult(ExePathOutcome.NO_VALID_CMD, f"{text}; along its path: {reason}" if reason else text)


def outside_map(place: str, limits: str = "") -> ControlResult:
    """Failure of a controller whose robot stands off its map, whose ``limits`` may be added."""
    text = f"the robot {place} is outside the map{f': {limits}' if limits else ''}"
    return ControlResult(ExePathOutcome.OUT_OF_MAP, text)
