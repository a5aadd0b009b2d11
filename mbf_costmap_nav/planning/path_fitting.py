"""Fits what a planner over cells has found to the robot's outline, or says where and why that is not possible.

When to use: by ``GridPlanner``, around its search. When not: ``costmap.hybrid_astar``, which searches with the outline.

The start must fit as the robot stands, the goal at its heading or within the tolerances of it, and the legs all along,
with manoeuvres where that needs them. A failure names the place, the cell that would be touched, and at the start how
the robot can get away.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose, normalize_angle
from mbf_abstract.goals.arrival_tolerance import not_even_beside
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import Costmap
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.map.pose_checks import find_valid_pose
from mbf_costmap_nav.planning.manoeuvres import Fitted, Manoeuvres, Misfit
from mbf_costmap_nav.planning.permanent_walls import touches_walls
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters

FloatArray = NDArray[np.float64]


class PathFitting:
    """One plan's questions about the outline.

    Parameters
    ----------
    costmap : LayeredCostmap
        Its padded outline is the one that must fit.
    snapshot : Costmap
        Of it; the one the plan is made on.
    min_turning_radius : float
        Of the robot [m]; 0 = it turns on the spot.
    manoeuvres : bool
        Whether a path may be changed where the outline does not fit.
    """

    def __init__(
        self,
        costmap: LayeredCostmap,
        snapshot: Costmap,
        parameters: GridPlannerParameters,
        min_turning_radius: float,
        token: CancelToken,
        *,
        manoeuvres: bool = True,
    ) -> None:
        self._costmap, self._snapshot = costmap, snapshot
        self._check = FootprintCheck(costmap.footprint, snapshot.resolution)
        self._manoeuvres = Manoeuvres(
            snapshot,
            costmap.footprint,
            min_turning_radius,
            parameters.cost_factor,
            parameters.allow_unknown,
            parameters.max_manoeuvre_states if manoeuvres else 0,
            token,
        )

    def start_problem(self, start: Pose) -> PlanResult | None:
        """Failure for a robot that touches something where it stands: no controller drives it from there."""
        touched = self._touched(start)
        if not touched:
            return None
        text = f"the robot touches {touched} at the start {_text(start)}; {getting_free(self._costmap, start)}"
        return PlanResult(GetPathOutcome.BLOCKED_START, text, permanent=touches_walls(self._costmap, start))

    def fitting_goal(self, request: PlanRequest) -> Pose | PlanResult:
        """Return the goal or, where the outline does not fit, the nearest pose within the tolerances where it does."""
        goal = request.goal
        touched = self._touched(goal)
        if not touched:
            return goal
        outline = self._costmap.footprint
        near = find_valid_pose(self._snapshot, outline, goal, request.dist_tolerance, request.angle_tolerance).pose
        if near is not None:
            return near
        text = f"the robot would touch {touched} at the goal {_text(goal)}"
        if (turned := find_valid_pose(self._snapshot, outline, goal, 0.0, math.pi).pose) is not None:
            text += f"; it fits there with the heading {turned.yaw:.2f} rad"
        return not_even_beside(PlanResult(GetPathOutcome.BLOCKED_GOAL, text), request.dist_tolerance)

    def fit(self, pieces: list[FloatArray], start: Pose, goal: Pose, tolerance: float) -> list[Fitted] | PlanResult:
        """Fit the legs (k, 2) [m] of a path from ``start`` on; the last one ends with the heading of ``goal``.

        It may end up to ``tolerance`` [m] from there.
        """
        fitted: list[Fitted] = []
        yaw = start.yaw
        for number, piece in enumerate(pieces):
            is_last = number == len(pieces) - 1
            spare = tolerance - math.dist(piece[-1].tolist(), (goal.x, goal.y)) if is_last else 0.0
            leg = self._manoeuvres.fit(piece, yaw, goal.yaw if is_last else None, spare)
            if isinstance(leg, Misfit):
                return self._failure(leg, start)
            fitted.append(leg)
            yaw = yaw if is_last else leg.end_yaw
        return fitted

    def _failure(self, misfit: Misfit, start: Pose) -> PlanResult:
        pose = Pose.planar(*misfit.pose)
        text = f"at {_text(pose)} the robot would touch {self._touched(pose)}, and no manoeuvre was found"
        if misfit.at_start and math.dist(misfit.pose[:2], (start.x, start.y)) == 0.0:
            text = f"turning from the start {_text(start)} to the path, {text}; {getting_free(self._costmap, start)}"
            return PlanResult(GetPathOutcome.BLOCKED_START, text)
        outcome = GetPathOutcome.BLOCKED_GOAL if misfit.at_end else GetPathOutcome.NO_PATH_FOUND
        return PlanResult(outcome, f"the path is too narrow for the robot's outline: {text}")

    def _touched(self, pose: Pose) -> str:
        """The lethal cell the outline touches at a pose, as a text; empty if none."""
        place = self._check.touched(self._snapshot, pose.x, pose.y, pose.yaw)
        return "" if place is None else f"the lethal cell at ({place[0]:.2f}, {place[1]:.2f})"


def _text(pose: Pose) -> str:
    return f"({pose.x:.2f}, {pose.y:.2f}, {pose.yaw:.2f} rad)"


def shifted_request(request: PlanRequest, goal: Pose) -> PlanRequest:
    """The request for a goal within its tolerances, with what is left of them."""
    gap = math.hypot(goal.x - request.goal.x, goal.y - request.goal.y)
    turn = abs(normalize_angle(goal.yaw - request.goal.yaw))
    left = max(request.dist_tolerance - gap, 0.0), max(request.angle_tolerance - turn, 0.0)
    return replace(request, goal=goal, dist_tolerance=left[0], angle_tolerance=left[1])
