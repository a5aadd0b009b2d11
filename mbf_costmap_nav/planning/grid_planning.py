"""What the grid planners share: the checks, tolerance and via poses, and the conversion of cells to a path.

A grid planner derives ``GridPlanner`` and writes one method, ``search``: from a start to a goal on a ``SearchGrid``.
Everything else a client can request - exact start and goal poses, goal tolerance, via poses, outcomes with a
message that names cell, cost and distance, cancelling - is done once, here.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.goals.arrival_tolerance import ends_beside, not_even_beside
from mbf_abstract.maps.getting_free import getting_free
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_costmap_nav.control.path_geometry import resample
from mbf_costmap_nav.grid.costmap import INSCRIBED, Costmap
from mbf_costmap_nav.map.layered_costmap import LayeredCostmap
from mbf_costmap_nav.planning.manoeuvres import Fitted
from mbf_costmap_nav.planning.path_assembly import assembled
from mbf_costmap_nav.planning.path_fitting import PathFitting, shifted_request
from mbf_costmap_nav.planning.permanent_walls import is_in_walls, is_permanently_unreachable, never_fits
from mbf_costmap_nav.planning.search_grid import Cell, GridPlannerParameters, SearchGrid, SearchWorkspace
from mbf_costmap_nav.plugins import CostmapContext, CostmapPlanner

FloatArray = NDArray[np.float64]

DOES_NOT_FIT = (GetPathOutcome.BLOCKED_GOAL, GetPathOutcome.NO_PATH_FOUND)
"""Outcomes of a path whose end the outline does not fit at, or that it does not fit on."""


@dataclass(frozen=True)
class Leg:
    """What a search found: points on the map from the start to the end, and the cost [m, weighted].

    ``reached_goal`` is False where the leg ends at the nearest reachable cell within the tolerance instead. Without a
    path, or when the token was set, there are no points.
    """

    points: FloatArray
    cost: float = 0.0
    reached_goal: bool = True


NO_LEG = Leg(np.zeros((0, 2)))


class GridPlanner(CostmapPlanner):
    """Base of the planners that search over cells."""

    Parameters: ClassVar[type[PluginParameters]] = GridPlannerParameters
    parameters: GridPlannerParameters
    plans_manoeuvres: ClassVar[bool] = True
    """Whether a path may leave what the search has found where the robot's outline does not fit."""

    def __init__(self, context: CostmapContext) -> None:
        super().__init__(context)
        self._workspace = SearchWorkspace()

    @property
    def avoided_share(self) -> float:
        """Its ``lethal_cost`` over the highest cost of a cell that is no obstacle."""
        return self.parameters.lethal_cost / (INSCRIBED - 1)

    @property
    def pose_spacing(self) -> float:
        """Largest distance [m] of two poses of the path; 0 = as the search gives them."""
        return 0.0

    @abstractmethod
    def search(self, grid: SearchGrid, start: Pose, goal: Pose, tolerance: float) -> Leg:
        """Find a path from ``start``, in a free cell, to the goal or a reachable cell within ``tolerance`` [m] of it.

        Implementations poll the grid's cancel token.
        """

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan from the start over the via poses to the goal, and fit the path to the robot's outline."""
        check_tolerance(request.dist_tolerance)
        grid = SearchGrid.build(self.costmap.snapshot(), self.parameters, request.cancel_token, self._workspace)
        # 1. Do the ends fit?
        fitting, goal = self._fitting(grid), request.goal
        if fitting is None:
            return self._plan_to(goal, grid, None, request)
        problem = self._check_start(grid, request.start) or fitting.start_problem(request.start)
        blocked_cell = grid.is_blocked(grid.cell_of(goal))  # the search says so, or looks for one near by
        end = problem or (goal if blocked_cell else fitting.fitting_goal(request))
        if isinstance(end, PlanResult):
            end = marked_if_permanent(end, self.costmap, request.start, goal, request.dist_tolerance)
            return marked_if_never_fits(end, self.costmap, goal, request.dist_tolerance, request.angle_tolerance)
        result = self._plan_to(end, grid, fitting, request)
        # The cell near by that the search has found may be too near to what blocks the goal for the outline.
        if blocked_cell and request.dist_tolerance > 0.0 and result.outcome in DOES_NOT_FIT:
            beside = fitting.fitting_goal(request)
            return result if isinstance(beside, PlanResult) else self._plan_to(beside, grid, fitting, request)
        return result

    def _plan_to(self, goal: Pose, grid: SearchGrid, fitting: PathFitting | None, request: PlanRequest) -> PlanResult:
        """Plan to the request's goal or to a pose within its tolerances."""
        # 2. Search leg by leg.
        legs = self._search_legs(grid, request if goal is request.goal else shifted_request(request, goal))
        if isinstance(legs, PlanResult):
            return legs
        pieces, cost, reached_goal = legs
        # 3. Does the outline fit all along?
        if fitting is None:
            fitted = [Fitted(piece) for piece in pieces]
        else:
            left = 0.0 if goal is not request.goal else request.dist_tolerance
            answer = fitting.fit(pieces, request.start, goal, left)
            if request.cancel_token.cancelled:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            if isinstance(answer, PlanResult):
                return answer
            fitted = answer
        # 4. One path of all legs.
        path, length = assembled(fitted, request, goal, grid.costmap.frame_id, self.clock.now())
        message = f"{len(path)} poses, {length:.2f} m"
        off = math.dist(path.positions[-1, :2].tolist(), (request.goal.x, request.goal.y))
        if not reached_goal or off > 1e-9:
            message += f", {ends_beside(off, request.dist_tolerance)}"
        return PlanResult(GetPathOutcome.SUCCESS, message, path, cost)

    def _fitting(self, grid: SearchGrid) -> PathFitting | None:
        """What asks about the outline; None if nothing is to be asked."""
        p = self.parameters
        if not p.check_footprint or len(self.costmap.footprint.vertices) < 3:
            return None
        robot = self.min_turning_radius
        return PathFitting(self.costmap, grid.costmap, p, robot, grid.token, manoeuvres=self.plans_manoeuvres)

    def _search_legs(self, grid: SearchGrid, request: PlanRequest) -> tuple[list[FloatArray], float, bool] | PlanResult:
        """Points (n, 2) [m] of each leg, their cost, and whether the last one reaches the goal; or a failure."""
        poses = (request.start, *request.via, request.goal)
        failure = self._check_start(grid, request.start)
        pieces: list[FloatArray] = []
        cost, reached_goal = 0.0, True
        for number, (start, goal) in enumerate(pairwise(poses)):
            is_last = number == len(poses) - 2
            tolerance = request.dist_tolerance if is_last else 0.0
            name = "goal" if is_last else f"via pose {number + 1}"
            failure = failure or self._check_goal(grid, goal, tolerance, name)
            leg = NO_LEG if failure or request.cancel_token.cancelled else self.search(grid, start, goal, tolerance)
            if request.cancel_token.cancelled:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            if len(leg.points) == 0:
                failure = failure or not_even_beside(self._no_path(grid, start, goal, name), tolerance)
                return marked_if_permanent(failure, self.costmap, start, goal, tolerance, self.parameters.lethal_cost)
            reached_goal = leg.reached_goal and grid.costmap.contains(goal.x, goal.y)
            piece = grid.with_exact_ends(leg.points, start, goal if reached_goal else None)
            pieces.append(resample(piece, self.pose_spacing) if self.pose_spacing > 0.0 else piece)
            cost += leg.cost
        return pieces, cost, reached_goal

    def _check_start(self, grid: SearchGrid, start: Pose) -> PlanResult | None:
        cell = grid.costmap.world_to_cell(start.x, start.y)
        if cell is None:
            return off_map(grid.costmap, start, "start")
        if grid.is_blocked(cell):
            text = f"{self._blocked(grid, 'start', start, cell)}; {getting_free(self.costmap, start)}"
            stays = is_in_walls(self.costmap, start, self.parameters.lethal_cost)
            return PlanResult(GetPathOutcome.BLOCKED_START, text, permanent=stays)
        return None

    def _check_goal(self, grid: SearchGrid, goal: Pose, tolerance: float, name: str) -> PlanResult | None:
        cell = grid.cell_of(goal)
        if grid.is_blocked(cell) and tolerance <= 0.0 and grid.costmap.contains(goal.x, goal.y):
            return PlanResult(GetPathOutcome.BLOCKED_GOAL, self._blocked(grid, name, goal, cell))
        return off_map(grid.costmap, goal, name, tolerance)

    def _blocked(self, grid: SearchGrid, name: str, pose: Pose, cell: Cell) -> str:
        text = f"{name} ({pose.x:.2f}, {pose.y:.2f}) lies in cell {cell} of cost {grid.costmap.cost(*cell)}"
        layer = self.costmap.lethal_reason(pose.x, pose.y)
        return f"{text}, lethal in layer {layer}" if layer else text

    def _no_path(self, grid: SearchGrid, start: Pose, goal: Pose, name: str) -> PlanResult:
        """Failure that distinguishes a goal without a reachable cell around it from a goal behind walls."""
        cell = grid.cell_of(goal)
        if grid.is_blocked(cell) or not grid.costmap.contains(goal.x, goal.y):
            return PlanResult(GetPathOutcome.BLOCKED_GOAL, self._blocked(grid, name, goal, cell))
        distance = math.hypot(goal.x - start.x, goal.y - start.y)
        ends = f"({start.x:.2f}, {start.y:.2f}) to the {name} ({goal.x:.2f}, {goal.y:.2f})"
        return PlanResult(GetPathOutcome.NO_PATH_FOUND, f"no path from {ends}, {distance:.2f} m away")


def marked_if_permanent(
    failure: PlanResult,
    costmap: LayeredCostmap,
    start: Pose,
    goal: Pose,
    tolerance: float,
    lethal_cost: int = INSCRIBED,
) -> PlanResult:
    """Return a failure to find a path; it is permanent where permanent walls separate start and goal."""
    if failure.outcome not in (GetPathOutcome.NO_PATH_FOUND, GetPathOutcome.BLOCKED_GOAL):
        return failure
    if not is_permanently_unreachable(costmap, start, goal, tolerance, lethal_cost):
        return failure
    text = f"{failure.message}; walls of the static map separate them"
    return replace(failure, message=text, permanent=True)


def marked_if_never_fits(
    failure: PlanResult, costmap: LayeredCostmap, goal: Pose, tolerance: float, angle_tolerance: float
) -> PlanResult:
    """Return a failure; BLOCKED_GOAL is permanent where permanent walls leave the outline no place at the goal."""
    if failure.permanent or failure.outcome != GetPathOutcome.BLOCKED_GOAL:
        return failure
    if not never_fits(costmap, goal, tolerance, angle_tolerance):
        return failure
    return replace(failure, message=f"{failure.message}; walls of the static map are there", permanent=True)


def check_tolerance(tolerance: float) -> None:
    """Raise ValueError unless a tolerance [m] is 0 or more; inf means anywhere."""
    if not tolerance >= 0.0:
        raise ValueError(f"dist_tolerance must be 0 m or more (inf = anywhere), got {tolerance}")


def off_map(costmap: Costmap, pose: Pose, name: str, tolerance: float = 0.0) -> PlanResult | None:
    """Failure for a pose off the map, unless a cell's centre is within ``tolerance`` [m] of it."""
    if costmap.contains(pose.x, pose.y):
        return None
    centre = costmap.cell_to_world(*costmap.world_to_cell_clamped(pose.x, pose.y))
    if math.dist(centre, (pose.x, pose.y)) <= tolerance:
        return None
    return PlanResult(GetPathOutcome.OUT_OF_MAP, f"{name} ({pose.x:.2f}, {pose.y:.2f}) is outside {costmap}")
