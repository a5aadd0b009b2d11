"""Hybrid A*: paths a car-like robot can drive, with its turning circle, its heading at the goal, and reversing.

When to use: Ackermann robots, and long robots that do not fit everywhere at every heading. When not: robots that turn
in place; ``costmap.astar`` or ``costmap.theta_star`` are 10 to 100 times faster and give shorter paths.
Known failure: like every search with bins it can miss a passage hardly wider than the robot; ``max_states`` bounds the
time it takes to say so.

Formula: Dolgov et al. 2010, curves after Dubins and after Reeds and Shepp; see ``kernels.hybrid_astar`` and
``kernels.car_curves``. The footprint is checked at every state and along the final curve. The goal tolerance applies
where the goal itself does not fit: the nearest cell centre within it at the goal's heading is taken.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Path, Pose, quaternion_from_yaw
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_costmap_nav.costmap import Costmap
from mbf_costmap_nav.footprint_check import FootprintCheck
from mbf_costmap_nav.grid_planning import GridPlannerParameters, SearchGrid
from mbf_costmap_nav.kernels.grid_search import CANCELED, search
from mbf_costmap_nav.kernels.hybrid_astar import hybrid_search, pose_cost
from mbf_costmap_nav.plugins import CostmapPlanner

FloatArray = NDArray[np.float64]


class HybridAStarParameters(PluginParameters):
    """Parameters of ``costmap.hybrid_astar``."""

    min_turning_radius: float = parameter(0.5, "Radius of the tightest curve.", unit="m", gt=0.0, le=100.0)
    allow_reversing: bool = parameter(True, "Reeds-Shepp curves; otherwise Dubins curves, forward only.")
    cost_factor: float = parameter(2.0, "How much longer a way through cells of cost 252 counts.", ge=0.0, le=1000.0)
    reverse_penalty: float = parameter(2.0, "Factor on the length driven backward.", ge=1.0, le=100.0)
    change_penalty: float = parameter(0.3, "Cost of a change of direction.", unit="m", ge=0.0, le=100.0)
    turning_penalty: float = parameter(1.05, "Factor on the length of curves.", ge=1.0, le=100.0)
    max_states: int = parameter(1_000_000, "Give up after so many states.", ge=100, le=100_000_000)


class HybridAStarPlanner(CostmapPlanner):
    """Kinematic planner for car-like robots."""

    Parameters: ClassVar[type[PluginParameters]] = HybridAStarParameters
    parameters: HybridAStarParameters

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan from the start over the via poses to the goal, each with its heading."""
        costmap = self.costmap.snapshot()
        check = FootprintCheck(self.costmap.footprint, costmap.resolution)
        names = ["start", *(f"via pose {i}" for i in range(len(request.via))), "goal"]
        poses = [request.start, *request.via, request.goal]
        if request.dist_tolerance > 0.0:
            poses[-1] = self._fitting_goal(costmap, check, request.goal, request.dist_tolerance)
        for name, pose in zip(names, poses, strict=True):
            failure = self._check(costmap, check, name, pose)
            if failure:
                return failure
        pieces: list[FloatArray] = []
        cost = 0.0
        for start, goal in pairwise(poses):
            status, piece, leg_cost, expanded = self._search(costmap, check, start, goal, request)
            if status == CANCELED:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            if len(piece) == 0:
                text = f"no drivable way from ({start.x:.2f}, {start.y:.2f}) to ({goal.x:.2f}, {goal.y:.2f})"
                return PlanResult(GetPathOutcome.NO_PATH_FOUND, f"{text} after {expanded} states")
            pieces.append(piece if not pieces else piece[1:])
            cost += leg_cost
        path = to_path(np.concatenate(pieces), costmap.frame_id, self.clock.now())
        return PlanResult(GetPathOutcome.SUCCESS, f"{len(path)} poses, {path.length:.2f} m", path, cost)

    def _search(
        self, costmap: Costmap, check: FootprintCheck, start: Pose, goal: Pose, request: PlanRequest
    ) -> tuple[int, FloatArray, float, int]:
        p, flag = self.parameters, request.cancel_token.flag
        grid = SearchGrid.build(costmap, GridPlannerParameters(cost_factor=0.0, allow_unknown=False))
        goal_cell = grid.index(costmap.world_to_cell_clamped(goal.x, goal.y))
        status, g = search(grid.cells, grid.stride, grid.table, goal_cell, -1, 0.0, True, False, flag)
        if status == CANCELED:
            return CANCELED, np.zeros((0, 3)), 0.0, 0
        field = np.ascontiguousarray(g.reshape(-1, grid.stride)[1:-1, 1:-1])
        return hybrid_search(
            costmap.cells,
            np.array([costmap.resolution, costmap.origin_x, costmap.origin_y]),
            check.samples,
            field,
            np.array([start.x, start.y, start.yaw]),
            np.array([goal.x, goal.y, goal.yaw]),
            p.min_turning_radius,
            p.allow_reversing,
            np.array([p.cost_factor, p.reverse_penalty, p.change_penalty, p.turning_penalty]),
            p.max_states,
            flag,
        )

    def _check(self, costmap: Costmap, check: FootprintCheck, name: str, pose: Pose) -> PlanResult | None:
        if not costmap.contains(pose.x, pose.y):
            text = f"{name} ({pose.x:.2f}, {pose.y:.2f}) is outside {costmap}"
            return PlanResult(GetPathOutcome.OUT_OF_MAP, text)
        if fits(costmap, check, pose):
            return None
        outcome = GetPathOutcome.BLOCKED_START if name == "start" else GetPathOutcome.BLOCKED_GOAL
        text = f"the robot does not fit at the {name} ({pose.x:.2f}, {pose.y:.2f}, {pose.yaw:.2f} rad)"
        return PlanResult(outcome, f"{text}, centre cost {costmap.cost_at(pose.x, pose.y)}")

    def _fitting_goal(self, costmap: Costmap, check: FootprintCheck, goal: Pose, tolerance: float) -> Pose:
        """Return the goal, or the nearest cell centre within the tolerance where the robot fits, if there is one."""
        if fits(costmap, check, goal):
            return goal
        reach = math.ceil(tolerance / costmap.resolution)
        ix, iy = costmap.world_to_cell_clamped(goal.x, goal.y)
        around = np.stack(np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)), axis=-1)
        centres = costmap.cells_to_world(around.reshape(-1, 2) + np.array([ix, iy]))
        distances = np.hypot(centres[:, 0] - goal.x, centres[:, 1] - goal.y)
        for i in np.argsort(distances, kind="stable").tolist():
            if distances[i] > tolerance:
                break
            candidate = Pose.planar(centres[i, 0], centres[i, 1], goal.yaw, frame_id=goal.frame_id)
            if fits(costmap, check, candidate):
                return candidate
        return goal


def fits(costmap: Costmap, check: FootprintCheck, pose: Pose) -> bool:
    """Whether the whole footprint lies on the map and off lethal cells, the centre off inscribed ones."""
    geometry = np.array([costmap.resolution, costmap.origin_x, costmap.origin_y])
    return bool(pose_cost(costmap.cells, geometry, check.samples, np.array([pose.x, pose.y, pose.yaw])) >= 0)


def to_path(poses: FloatArray, frame_id: str, stamp: float) -> Path:
    """Path of poses (n, 3: x, y, yaw); where the robot reverses the headings look against the way."""
    orientations = np.array([quaternion_from_yaw(yaw) for yaw in poses[:, 2]])
    positions = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    return Path(positions, orientations, frame_id, stamp)
