"""One snapshot of a costmap for the grid planners: padded, weighted, with queries for lines and goal cells.

When to use: by planners that search over cells. When not: anything that only looks cells up; ``Costmap`` does that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import PluginParameters, parameter
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.kernels.map.line_cells import cost_along
from mbf_costmap_nav.kernels.search.exact_ends import cell_centres, with_exact_ends
from mbf_costmap_nav.kernels.search.nearest_cell import nearest_reached
from mbf_costmap_nav.kernels.search.padded_grid import PaddedGrid, pad_cells
from mbf_costmap_nav.kernels.search.search_cells import Box, whole_grid

Cell = tuple[int, int]
Memory = TypeVar("Memory")

TABLES_KEPT = 32
NEAR_END = 0.75
"""Points this near [cells] to an exact start or goal are dropped: going there first would be a step back."""
NO_ROBOT = np.zeros((0, 2))
"""Footprint samples of a robot that fits everywhere."""


class GridPlannerParameters(PluginParameters):
    """Parameters every grid planner has."""

    cost_factor: float = parameter(
        3.0, "Relative extra length of a path through cells of cost 252; 0 = shortest path.", ge=0.0, le=1000.0
    )
    lethal_cost: int = parameter(
        253, "Cells of this cost and above are obstacles (unknown has a parameter of its own).", ge=1, le=254
    )
    allow_unknown: bool = parameter(True, "Plan through unknown cells, counted like cost 252.")
    check_footprint: bool = parameter(
        True, "Check the robot's outline on the path and its turns at the ends; plan a manoeuvre where it does not fit."
    )
    max_manoeuvre_states: int = parameter(
        20_000, "The search for a manoeuvre gives up after so many states.", ge=100, le=10_000_000
    )


class SearchWorkspace:
    """Memory of one planner's grid searches, which are all of one kind, kept from plan to plan.

    Getting fresh pages from the system takes a tenth of a search, and twice as long as a search if others used them.
    While the map stays the same, a search cleans up only after the one before: on large maps that is the smaller part.
    """

    def __init__(self) -> None:
        self._memory: Any = None
        self._touched = np.zeros(4, dtype=np.int64)
        self._searched: NDArray[np.uint8] | None = None  # the padded cells that the memory was written for
        self._costmap: Costmap | None = None
        self._padded = np.zeros(0, dtype=np.uint8)

    def padded_cells(self, costmap: Costmap, token: CancelToken) -> NDArray[np.uint8]:
        """Return the padded cells of a snapshot, the same ones as long as it is the same."""
        if costmap is self._costmap:
            return self._padded
        padded = pad_cells(costmap.cells, LETHAL, token.flag)
        if not (costmap.cells.flags.writeable or token.cancelled):  # cells that stay, and all of them
            self._costmap, self._padded = costmap, padded
        return padded

    def memory(self, grid: PaddedGrid, make: Callable[[int], Memory]) -> tuple[Memory, Box]:
        """Memory of a kind for a search on a grid, and the box of what is to be written anew, to be kept up to date."""
        if self._searched is not grid.cells:
            if self._searched is None or self._searched.size != grid.cells.size:
                self._memory = make(grid.cells.size)
            self._searched, self._touched = grid.cells, whole_grid(grid.cells, grid.stride)
        return self._memory, self._touched


@dataclass(frozen=True)
class SearchGrid:
    """One snapshot, prepared for the kernels: flat and padded by one blocked cell on every side.

    Attributes
    ----------
    padded : PaddedGrid
        Its costs and their traversal, 1 for free, inf for blocked.
    first_blocked : int
        Least cost that blocks.
    token : CancelToken
        Ends long searches early; their results are then invalid.
    workspace : SearchWorkspace
        The planner's memory for ``grid_search.search``; it holds the result of the last search.
    """

    costmap: Costmap
    padded: PaddedGrid
    first_blocked: int
    token: CancelToken
    workspace: SearchWorkspace

    @classmethod
    def build(
        cls,
        costmap: Costmap,
        parameters: GridPlannerParameters,
        token: CancelToken,
        workspace: SearchWorkspace | None = None,
    ) -> SearchGrid:
        """Prepare a snapshot with the costs of a planner."""
        table = traversal_table(parameters.cost_factor, parameters.lethal_cost, parameters.allow_unknown)
        workspace = workspace or SearchWorkspace()
        padded = PaddedGrid(workspace.padded_cells(costmap, token), costmap.width + 2, table)
        return cls(costmap, padded, parameters.lethal_cost, token, workspace)

    def memory(self, make: Callable[[int], Memory]) -> tuple[Memory, Box]:
        """Memory for a search on this grid, see ``SearchWorkspace``; it holds what the last one left there."""
        return self.workspace.memory(self.padded, make)

    @property
    def geometry(self) -> NDArray[np.float64]:
        """(resolution, origin_x, origin_y) [m], as the kernels take it."""
        return np.array([self.costmap.resolution, self.costmap.origin_x, self.costmap.origin_y])

    def index(self, cell: Cell) -> int:
        """Flat padded index of a cell (ix, iy)."""
        return (cell[1] + 1) * self.padded.stride + cell[0] + 1

    def cell_of(self, pose: Pose) -> Cell:
        """Cell that holds a pose, or the nearest one of the map."""
        return self.costmap.world_to_cell_clamped(pose.x, pose.y)

    def points(self, indices: NDArray[np.int32]) -> NDArray[np.float64]:
        """Centres (n, 2) [m] of flat padded indices (n,)."""
        centres: NDArray[np.float64] = cell_centres(indices, self.padded.stride, self.geometry)
        return centres

    def is_blocked(self, cell: Cell) -> bool:
        """Whether the planner may not enter a cell."""
        return math.isinf(self.padded.table[self.costmap.cost(*cell)])

    def is_free_line(self, a: ArrayLike, b: ArrayLike) -> bool:
        """Whether the line between two points (x, y) [m] runs through no blocked cell and does not leave the map."""
        grid = self.costmap
        ends = [
            (value - origin) / grid.resolution
            for point in (a, b)
            for value, origin in zip(np.asarray(point).tolist(), (grid.origin_x, grid.origin_y), strict=True)
        ]
        return int(cost_along(grid.cells, self._unknown_on_lines, *ends)) < self.first_blocked

    def with_exact_ends(self, points: NDArray[np.float64], start: Pose, goal: Pose | None) -> NDArray[np.float64]:
        """Replace the cell centres (n, 2) [m] at the ends by the exact start, and by the exact goal if it is given."""
        goal_x, goal_y = (math.nan, math.nan) if goal is None else (goal.x, goal.y)
        lines = self.costmap.cells, self._unknown_on_lines, self.first_blocked, self.geometry
        given, near = np.ascontiguousarray(points, dtype=np.float64), NEAR_END * self.costmap.resolution
        exact: NDArray[np.float64] = with_exact_ends(*lines, given, start.x, start.y, goal_x, goal_y, near)
        return exact

    @property
    def _unknown_on_lines(self) -> int:
        """What an unknown cell counts as on a line."""
        return LETHAL if math.isinf(self.padded.table[UNKNOWN]) else 0

    def nearest_reached(
        self, g: NDArray[np.float32], goal: Pose, tolerance: float, samples: NDArray[np.float64] = NO_ROBOT
    ) -> Cell | None:
        """Cell of finite ``g`` whose centre is nearest to the goal, at most ``tolerance`` [m] away; None without one.

        Of equally near cells the one of lower ``g`` counts. With footprint ``samples`` (n, 2) [m] the robot must fit
        there at the goal's heading.
        """
        unknown = LETHAL if math.isinf(self.padded.table[UNKNOWN]) else LETHAL - 2
        wanted = np.array([goal.x, goal.y, goal.yaw])
        ix, iy = nearest_reached(
            g, self.costmap.cells, unknown, self.geometry, samples, wanted, tolerance, self.token.flag
        )
        return None if ix < 0 else (int(ix), int(iy))


@lru_cache(maxsize=TABLES_KEPT)
def traversal_table(cost_factor: float, lethal_cost: int, allow_unknown: bool) -> NDArray[np.float32]:
    """(256,) float32: weight of a metre by cell cost, 1 + cost_factor * cost / 252; inf where blocked.

    Not to be written to: other plans have the same array. Writable, as kernels know one kind of arrays.
    """
    costs = np.minimum(np.arange(256), 252)
    table = (1.0 + cost_factor * costs / 252.0).astype(np.float32)
    table[lethal_cost:UNKNOWN] = np.inf
    table[UNKNOWN] = table[UNKNOWN] if allow_unknown else np.inf
    return table
