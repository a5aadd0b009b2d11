"""What the grid planners share: parameters, the padded search grid, the checks, and the way from cells to a path.

A grid planner derives ``GridPlanner`` and writes one method, ``search``: from a start cell to a goal cell on a
``SearchGrid``. Everything a client can ask for beside that - exact start and goal poses, goal tolerance, via poses,
outcomes with a message that names cell, cost and distance, cancelling - is done once, here.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.cancel import CancelToken
from mbf_abstract.geometry import Path, Pose
from mbf_abstract.outcomes import GetPathOutcome
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.plugins import PlanRequest, PlanResult
from mbf_costmap_nav.costmap import LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.kernels.grid_search import pad_cells
from mbf_costmap_nav.path_geometry import resample
from mbf_costmap_nav.plugins import CostmapPlanner

Cell = tuple[int, int]

NEAR_END = 0.75
"""Points this near [cells] to an exact start or goal are dropped: going there first would be a step back."""


class GridPlannerParameters(PluginParameters):
    """Parameters every grid planner has."""

    cost_factor: float = parameter(
        3.0, "How much longer a way through cells of cost 252 counts, in lengths; 0 = shortest way.", ge=0.0, le=1000.0
    )
    lethal_cost: int = parameter(
        253, "Cells of this cost and above are obstacles (unknown is asked apart).", ge=1, le=254
    )
    allow_unknown: bool = parameter(True, "Plan through unknown cells, counted like cost 252.")


@dataclass(frozen=True)
class SearchGrid:
    """One snapshot, prepared for the kernels: flat and padded by one blocked cell on every side.

    Attributes
    ----------
    costmap : Costmap
    cells : (n,) uint8
        Flat padded costs.
    stride : int
        Row length of the padded grid.
    table : (256,) float32
        Traversal of each cost, 1 for free, inf for blocked.
    """

    costmap: Costmap
    cells: NDArray[np.uint8]
    stride: int
    table: NDArray[np.float32]

    @classmethod
    def build(cls, costmap: Costmap, parameters: GridPlannerParameters) -> SearchGrid:
        """Prepare a snapshot by the costs a planner wants."""
        table = traversal_table(parameters.cost_factor, parameters.lethal_cost, parameters.allow_unknown)
        return cls(costmap, pad_cells(costmap.cells, LETHAL), costmap.width + 2, table)

    def index(self, cell: Cell) -> int:
        """Flat padded index of a cell (ix, iy)."""
        return (cell[1] + 1) * self.stride + cell[0] + 1

    def points(self, indices: NDArray[np.int32]) -> NDArray[np.float64]:
        """Centres (n, 2) [m] of flat padded indices (n,)."""
        return self.costmap.cells_to_world(np.column_stack([indices % self.stride - 1, indices // self.stride - 1]))

    def is_blocked(self, cell: Cell) -> bool:
        """Whether the planner may not enter a cell."""
        return math.isinf(self.table[self.costmap.cost(*cell)])

    def nearest_reached(self, g: NDArray[np.float32], goal: Pose, tolerance: float) -> Cell | None:
        """Cell of finite ``g`` whose centre is nearest to the goal, at most ``tolerance`` [m] away; None without one.

        Equally near cells are told apart by their ``g``.
        """
        radius = math.ceil(tolerance / self.costmap.resolution) + 1
        gx, gy = self.costmap.world_to_cell_clamped(goal.x, goal.y)
        xs = np.arange(max(gx - radius, 0), min(gx + radius + 1, self.costmap.width))
        ys = np.arange(max(gy - radius, 0), min(gy + radius + 1, self.costmap.height))
        cells = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        distances = np.linalg.norm(self.costmap.cells_to_world(cells) - (goal.x, goal.y), axis=1)
        reached = g[(cells[:, 1] + 1) * self.stride + cells[:, 0] + 1]
        candidates = np.flatnonzero((distances <= tolerance) & np.isfinite(reached))
        if candidates.size == 0:
            return None
        best = candidates[np.lexsort((reached[candidates], np.round(distances[candidates], 6)))[0]]
        return int(cells[best, 0]), int(cells[best, 1])


def traversal_table(cost_factor: float, lethal_cost: int, allow_unknown: bool) -> NDArray[np.float32]:
    """(256,) float32: what a cell's cost makes of a metre, 1 + cost_factor * cost / 252; inf where blocked."""
    costs = np.minimum(np.arange(256), 252)
    table = (1.0 + cost_factor * costs / 252.0).astype(np.float32)
    table[lethal_cost:UNKNOWN] = np.inf
    table[UNKNOWN] = table[UNKNOWN] if allow_unknown else np.inf
    return table


@dataclass(frozen=True)
class Leg:
    """What a search found: points on the map from the start to the end, and the cost [m, weighted].

    ``reached_goal`` is False where the leg ends at the nearest reachable cell within the tolerance instead.
    ``canceled`` and an empty leg (no points) say why there is none.
    """

    points: NDArray[np.float64]
    cost: float = 0.0
    reached_goal: bool = True
    canceled: bool = False


NO_LEG = Leg(np.zeros((0, 2)))
CANCELED_LEG = Leg(np.zeros((0, 2)), canceled=True)


class GridPlanner(CostmapPlanner):
    """Base of the planners that search over cells."""

    Parameters: ClassVar[type[PluginParameters]] = GridPlannerParameters
    parameters: GridPlannerParameters

    @property
    def pose_spacing(self) -> float:
        """Largest distance [m] of two poses of the path; 0 = as the search gives them."""
        return 0.0

    @abstractmethod
    def search(self, grid: SearchGrid, start: Cell, goal: Pose, tolerance: float, token: CancelToken) -> Leg:
        """Find a way from ``start``, a free cell, to the goal's cell or a reachable one within ``tolerance`` [m]."""

    def make_plan(self, request: PlanRequest) -> PlanResult:
        """Plan from the start over the via poses to the goal."""
        if request.cancel_token.cancelled:
            return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
        grid = SearchGrid.build(self.costmap.snapshot(), self.parameters)
        poses = (request.start, *request.via, request.goal)
        failure = self._check_start(grid, request.start)
        pieces: list[NDArray[np.float64]] = []
        cost, reached_goal = 0.0, True
        for number, (start, goal) in enumerate(pairwise(poses)):
            is_last = number == len(poses) - 2
            tolerance = request.dist_tolerance if is_last else 0.0
            name = "goal" if is_last else f"via pose {number}"
            failure = failure or _check_goal(grid, goal, tolerance, name)
            start_cell = grid.costmap.world_to_cell(start.x, start.y)
            if failure or start_cell is None:
                return failure or PlanResult(GetPathOutcome.OUT_OF_MAP)
            leg = self.search(grid, start_cell, goal, tolerance, request.cancel_token)
            if leg.canceled:
                return PlanResult(GetPathOutcome.CANCELED, request.cancel_token.reason)
            if len(leg.points) == 0:
                return _no_path(grid, start, goal, tolerance, name)
            piece = _with_exact_ends(leg, start, goal, grid.costmap.resolution)
            pieces.append(resample(piece, self.pose_spacing) if self.pose_spacing > 0.0 else piece)
            cost += leg.cost
            reached_goal = leg.reached_goal
        path = _assemble(pieces, request, reached_goal, grid.costmap.frame_id, self.clock.now())
        message = f"{len(path)} poses, {path.length:.2f} m"
        if not reached_goal:
            off = math.dist(path.positions[-1][:2], (request.goal.x, request.goal.y))
            message += f", ends {off:.2f} m from the goal (tolerance {request.dist_tolerance:.2f} m)"
        return PlanResult(GetPathOutcome.SUCCESS, message, path, cost)

    def _check_start(self, grid: SearchGrid, start: Pose) -> PlanResult | None:
        cell = grid.costmap.world_to_cell(start.x, start.y)
        if cell is None:
            return PlanResult(
                GetPathOutcome.OUT_OF_MAP, f"start ({start.x:.2f}, {start.y:.2f}) is outside {grid.costmap}"
            )
        if grid.is_blocked(cell):
            return PlanResult(GetPathOutcome.BLOCKED_START, _blocked(grid, "start", start, cell))
        return None


def _check_goal(grid: SearchGrid, goal: Pose, tolerance: float, name: str) -> PlanResult | None:
    cell = grid.costmap.world_to_cell(goal.x, goal.y)
    if cell is None:
        return PlanResult(GetPathOutcome.OUT_OF_MAP, f"{name} ({goal.x:.2f}, {goal.y:.2f}) is outside {grid.costmap}")
    if grid.is_blocked(cell) and tolerance <= 0.0:
        return PlanResult(GetPathOutcome.BLOCKED_GOAL, _blocked(grid, name, goal, cell))
    return None


def _blocked(grid: SearchGrid, name: str, pose: Pose, cell: Cell) -> str:
    return f"{name} ({pose.x:.2f}, {pose.y:.2f}) lies in cell {cell} of cost {grid.costmap.cost(*cell)}"


def _no_path(grid: SearchGrid, start: Pose, goal: Pose, tolerance: float, name: str) -> PlanResult:
    """Tell a goal without a reachable cell around it from a goal behind walls."""
    cell = grid.costmap.world_to_cell(goal.x, goal.y)
    if cell is not None and grid.is_blocked(cell):
        text = f"{_blocked(grid, name, goal, cell)}, and no cell within {tolerance:.2f} m of it can be reached"
        return PlanResult(GetPathOutcome.BLOCKED_GOAL, text)
    distance = math.hypot(goal.x - start.x, goal.y - start.y)
    text = (
        f"no way from ({start.x:.2f}, {start.y:.2f}) to the {name} ({goal.x:.2f}, {goal.y:.2f}), {distance:.2f} m away"
    )
    return PlanResult(GetPathOutcome.NO_PATH_FOUND, text)


def _with_exact_ends(leg: Leg, start: Pose, goal: Pose, resolution: float) -> NDArray[np.float64]:
    """Replace the centres of the first and last cell, and what lies as near to the exact ends, by those."""
    first = np.array([[start.x, start.y]])
    last = np.array([[goal.x, goal.y]]) if leg.reached_goal else leg.points[-1:]
    inner = leg.points[1:-1]
    clear = np.minimum(np.hypot(*(inner - first).T), np.hypot(*(inner - last).T)) > NEAR_END * resolution
    return np.concatenate([first, inner[clear], last])


def _heights(points: NDArray[np.float64], request: PlanRequest) -> NDArray[np.float64]:
    """Heights [m] of a path on a flat map: from the start's to the goal's in even measure, as no map knows better."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    share = along / along[-1] if along[-1] > 0.0 else along
    return request.start.z + share * (request.goal.z - request.start.z)


def _assemble(
    pieces: list[NDArray[np.float64]], request: PlanRequest, reached_goal: bool, frame_id: str, stamp: float
) -> Path:
    """Join the legs; inner poses head along the path, the first and the last keep the orientations asked for."""
    points = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
    path = Path.from_points(np.column_stack([points, _heights(points, request)]), request.goal.orientation)
    assert path.orientations is not None
    orientations = path.orientations.copy()
    orientations[0] = request.start.orientation
    return Path(path.positions, orientations, frame_id, stamp)
