"""Speed limits of layers hold for whatever drives: controllers, recoveries and people at the stick, on every map.

A layer states them by ``MapLayer.speed_limit_at``. The core slows commands down along their arc, so a controller that
knows nothing of limits obeys them, too. One that looks ahead may ask by itself and brake in time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from mbf_abstract.geometry import Pose, Twist
from mbf_abstract.geometry.transform import TransformError
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.navigation_map import NavigationMap
from mbf_abstract.maps.tracking.contact_guard import slower
from mbf_abstract.outcomes import ExePathOutcome
from mbf_abstract.plugins import ControlResult

ROUNDING = 1e-6
"""A controller that drives at the limit by itself must not be corrected for its rounding."""


def lowest_limit(
    maps: Iterable[NavigationMap], transforms: TransformBuffer, pose: Pose, full_speed: float
) -> tuple[float, str]:
    """Lowest speed [m/s] that any of the maps allows at ``pose``, at most ``full_speed``, and where that is.

    Raises TransformError where the pose is not known on a map, ValueError where a layer allows no speed that is one.
    """
    limits = []
    for navigation_map in maps:
        there = transforms.transform_pose(pose, navigation_map.frame_id) if navigation_map.layers else pose
        limit = navigation_map.speed_limit_at(there, full_speed)
        limits.append((limit, f"the speed limit at ({there.x:.2f}, {there.y:.2f}) is {limit:g} m/s"))
    return min(limits, default=(full_speed, ""))


def within_speed_limit(
    maps: Iterable[NavigationMap], transforms: TransformBuffer, pose: Pose, answer: ControlResult, full_speed: float
) -> ControlResult:
    """The answer of a controller with a command within the limits at ``pose``; BLOCKED_PATH where that is no speed.

    ``full_speed`` [m/s] is what limits in percent are shares of; inf = unknown, then they do not count.
    """
    command = answer.command
    if command is None or command.speed == 0.0:
        return answer
    try:
        limit, place = lowest_limit(maps, transforms, pose, full_speed)
    except TransformError as error:
        return ControlResult(ExePathOutcome.TF_ERROR, str(error))
    share = share_allowed(command.speed, limit)
    if share == 0.0:
        return ControlResult(ExePathOutcome.BLOCKED_PATH, place)
    return answer if share == 1.0 else replace(answer, command=slower(command, share))


def slow_motion(
    maps: Iterable[NavigationMap], transforms: TransformBuffer, pose: Pose, motion: Twist
) -> tuple[Twist, str]:
    """A motion of a recovery within the limits at ``pose``, shares being those of its own speed; why it must not move.

    Raises as ``lowest_limit``.
    """
    if motion.speed == 0.0:
        return motion, ""
    limit, place = lowest_limit(maps, transforms, pose, abs(motion.speed))
    share = share_allowed(motion.speed, limit)
    slowed = motion if share == 1.0 else slower(motion, share)
    assert isinstance(slowed, Twist)
    return slowed, place if share == 0.0 else ""


def share_allowed(speed: float, limit: float) -> float:
    """The share of a speed [m/s] that a limit [m/s] leaves."""
    return 1.0 if abs(speed) <= limit * (1.0 + ROUNDING) else limit / abs(speed)
