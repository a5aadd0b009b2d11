"""How near its target a path must end, and how near its end a robot must come, to arrive within one tolerance.

A path may end beside its target, where that is occupied. Path and robot then share the arrival tolerance: a path that
is to be driven may end off the target by all but a quarter of it, and the robot has what is left.
"""

from __future__ import annotations

import math
from dataclasses import replace

from mbf_abstract.plugins import PlanResult

LARGEST_DISTANCE = 1000.0
"""Largest tolerance [m] of a goal's position; no robot has arrived that far from its goal."""

LARGEST_ANGLE = 2.0 * math.pi
"""Largest tolerance [rad] of a goal's heading; all headings are within pi; clients round that up, or send a turn."""

LEAST_SHARE_LEFT = 0.25
"""Of the tolerance, for stopping at the end of a path that does not reach the target."""


def plan_tolerance_problem(distance: float, angle: float) -> str:
    """Why a path or a pose may not be so far [m, rad] from its target; empty if it may. inf means anywhere."""
    if not (distance >= 0.0 and angle >= 0.0):  # not a number is no tolerance either
        return f"tolerances must not be negative, got {distance} m and {angle} rad"
    if LARGEST_DISTANCE < distance < math.inf:
        return f"dist_tolerance must be at most {LARGEST_DISTANCE:g} m (inf = anywhere), got {distance}"
    if LARGEST_ANGLE < angle < math.inf:
        return f"angle_tolerance must be at most {LARGEST_ANGLE:.2f} rad, got {angle}"
    return ""


def planned_tolerance(tolerance: float) -> float:
    """Distance [m] from its target at which a path may end that is driven to within ``tolerance`` [m] of it."""
    return (1.0 - LEAST_SHARE_LEFT) * tolerance


def tolerance_left(tolerance: float, off: float) -> float | None:
    """What a path that ends ``off`` [m] its target leaves of the arrival tolerance [m]; None = all of it.

    At least a quarter, for paths of planners that were allowed more, e.g. while a recovery relaxes their tolerance.
    """
    if off == 0.0 or tolerance == 0.0:
        return None
    return max(tolerance - off, LEAST_SHARE_LEFT * tolerance)


def ends_beside(distance: float, tolerance: float) -> str:
    """Text of a path that ends so far [m] from its goal, within its tolerance [m]."""
    return f"ends {distance:.2f} m from the goal (tolerance {tolerance:.2f} m)"


def not_even_beside(problem: PlanResult, tolerance: float) -> PlanResult:
    """Return a planner's failure, with the tolerance [m] of the goal that did not help; 0 = none was given."""
    if tolerance <= 0.0:
        return problem
    around = f"within {tolerance:.2f} m of it" if tolerance < math.inf else "anywhere"
    return replace(problem, message=f"{problem.message}; no place {around} can be reached either")
