"""Checks of what a goal asks for and of the path a planner returns, and their transformation to the global frame.

A planner may report success for an empty path, a path in another frame, one that starts or ends somewhere else, or one
that leads off the map.
Each becomes a failure that names what is wrong, so that no controller ever follows such a path.
"""

from __future__ import annotations

import math
from typing import Any

from mbf_abstract.event_values import error_text
from mbf_abstract.execution.runtime import Runtime
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_abstract.goals.arrival_tolerance import LARGEST_ANGLE, LARGEST_DISTANCE
from mbf_abstract.goals.goal_area import GoalArea, TransformedArea
from mbf_abstract.goals.goal_types import ExePathGoal, MoveBaseGoal
from mbf_abstract.goals.result_types import GetPathResult
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult


def in_global_frame(pose: Pose, runtime: Runtime) -> Pose:
    """Return ``pose`` in the global frame; raises TransformError where that frame is not known."""
    return runtime.transforms.transform_pose(pose, runtime.robot.global_frame)


def path_in_global_frame(path: Path, runtime: Runtime) -> Path:
    """Return ``path`` in the global frame; raises TransformError where that frame is not known."""
    return runtime.transforms.transform_path(path, runtime.robot.global_frame)


def area_in_global_frame(area: GoalArea | None, runtime: Runtime) -> GoalArea | None:
    """Return an area as it lies in the global frame now; raises TransformError where its frame is not known."""
    if area is None or area.frame_id == runtime.robot.global_frame:
        return area
    origin = in_global_frame(Pose.planar(0.0, 0.0, frame_id=area.frame_id), runtime)
    return TransformedArea(area, Transform.from_pose(origin, area.frame_id))


def tolerance_problem(goal: ExePathGoal | MoveBaseGoal) -> str:
    """Why the tolerances of a goal can not be used; empty if they can."""
    for name, largest in (("dist_tolerance", LARGEST_DISTANCE), ("angle_tolerance", LARGEST_ANGLE)):
        value = getattr(goal, name)
        if value is not None and not 0.0 < value <= largest:  # not a number is no tolerance either
            return f"{name} must be positive and at most {largest:.6g}, got {value}"
    return ""


def check_path(answer: PlanResult, request: PlanRequest, runtime: Runtime, area: GoalArea | None = None) -> PlanResult:
    """Check a successful answer; return it with the path in the global frame, or a failure without a path."""
    if answer.path is None or len(answer.path) == 0:
        return PlanResult(GetPathOutcome.EMPTY_PATH, "success was reported, but the path has no poses")
    try:
        path = path_in_global_frame(answer.path, runtime)
    except TransformError as error:
        return PlanResult(GetPathOutcome.TF_ERROR, f"the path cannot be transformed to the global frame: {error}")
    if area is not None and not area.contains(path[-1]):
        text = f"the path ends at {path[-1].position}, outside the goal area"
        return PlanResult(GetPathOutcome.INTERNAL_ERROR, text)
    goal = request.goal if area is None else path[-1]
    slack = runtime.parameters.plan_end_tolerance
    for name, index, wanted, tolerance in (
        ("start", 0, request.start, 0.0),
        ("goal", len(path) - 1, goal, request.dist_tolerance),
    ):
        distance = math.dist(path.positions[index].tolist(), wanted.position)
        if distance > tolerance + slack:
            text = f"pose {index} of the path is {distance:.2f} m from the {name}, allowed {tolerance + slack:.2f} m"
            return PlanResult(GetPathOutcome.INTERNAL_ERROR, text)
    if problem := leaves_map(path, runtime):
        return PlanResult(GetPathOutcome.INTERNAL_ERROR, problem)
    return PlanResult(answer.outcome, answer.message, path, answer.cost)


def leaves_map(path: Path, runtime: Runtime) -> str:
    """Where a path in any frame leads off the map, empty if it does not; also that the map could not say so."""
    try:
        problem: object = runtime.map_hooks.path_problem(path)
    except Exception as error:
        return f"the map's path_problem raised {type(error).__name__}: {error_text(error)}"
    return str(problem) if problem else ""


def path_result(
    answer: PlanResult,
    last: PlanResult | None,
    request: PlanRequest,
    runtime: Runtime,
    planner: str,
    area: GoalArea | None = None,
) -> GetPathResult:
    """Judge how planning ended: its path in the global frame, or why there is none.

    Parameters
    ----------
    answer, last : PlanResult
        What ends the goal, and the planner's own last answer; None if it was never asked.
    planner : str
        Its name.
    """
    fields: dict[str, Any] = {"planner": planner}
    if last is not None:
        fields.update(plugin_outcome=int(last.outcome), plugin_message=last.message)
    if not answer.success:
        return GetPathResult(
            int(answer.outcome), answer.message, cost=answer.cost, permanent=answer.permanent, **fields
        )
    checked = check_path(answer, request, runtime, area)
    if checked.path is None:
        return GetPathResult(checked.outcome, f"planner {planner!r}: {checked.message}", **fields)
    cost = answer.cost if answer.cost != 0.0 else checked.path.length
    return GetPathResult(int(answer.outcome), answer.message or "plan found", path=checked.path, cost=cost, **fields)
