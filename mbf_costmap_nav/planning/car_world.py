"""One snapshot for a car: where its outline fits, and what a planner keeps for its searches from plan to plan.

When to use: by ``car_search`` and ``costmap.hybrid_astar``. When not: robots that fit everywhere at every heading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.time.cancel import CancelToken
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.grid.footprint_check import FootprintCheck
from mbf_costmap_nav.kernels.car.ground import Ground, ground_of, pose_cost
from mbf_costmap_nav.kernels.car.hybrid_astar import hybrid_search
from mbf_costmap_nav.kernels.car.motion_primitives import Car
from mbf_costmap_nav.kernels.map.footprint_cost import first_collision
from mbf_costmap_nav.kernels.search.grid_search import FOUND, new_search_memory, search
from mbf_costmap_nav.kernels.search.lazy_field import FieldMemory
from mbf_costmap_nav.kernels.search.search_cells import whole_grid
from mbf_costmap_nav.planning.outline_course import BETWEEN_OF_A_CAR, dense
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters, SearchGrid, SearchWorkspace

FloatArray = NDArray[np.float64]

UNKNOWN_AS = 252
"""Cost of the unknown cells that may be driven through, as for the other planners."""
SPARE = (0.5, 0.2)
"""Room [cells] around the outline that a path keeps where it can."""


class CarWorkspace:
    """Memory of one planner's searches for a car, kept from plan to plan; see ``SearchWorkspace``.

    Attributes
    ----------
    from_start, from_goal : SearchWorkspace
        For the fields of costs from both ends.
    """

    def __init__(self) -> None:
        self.from_start, self.from_goal = SearchWorkspace(), SearchWorkspace()
        self._costmap: Costmap | None = None
        self._grounds: dict[tuple[object, ...], Ground] = {}

    def ground(self, costmap: Costmap, unknown: int, *outlines: FloatArray) -> Ground:
        """``ground_of`` a snapshot and samples (n, 2) [m]; the same one for a snapshot whose cells stay."""
        key: tuple[object, ...] = unknown, *(outline.tobytes() for outline in outlines)
        if costmap is not self._costmap:
            self._costmap, self._grounds = costmap, {}
        if key not in self._grounds or costmap.cells.flags.writeable:
            geometry = np.array([costmap.resolution, costmap.origin_x, costmap.origin_y])
            self._grounds[key] = ground_of(costmap.cells, unknown, geometry, *outlines)
        return self._grounds[key]


@dataclass(frozen=True)
class CarWorld:
    """One snapshot and the robot on it.

    Attributes
    ----------
    footprint : Footprint
    samples, larger, slightly_larger : (n, 2) float64
        Of the footprint [m], and of it with ``SPARE`` around it.
    unknown : int
        Cost of unknown cells.
    workspace : CarWorkspace
        The planner's memory; ``grid`` searches in it, too.
    """

    grid: SearchGrid
    footprint: Footprint
    samples: FloatArray
    larger: FloatArray
    slightly_larger: FloatArray
    unknown: int
    workspace: CarWorkspace

    @classmethod
    def build(
        cls,
        costmap: Costmap,
        footprint: Footprint,
        token: CancelToken,
        *,
        cost_factor: float,
        allow_unknown: bool,
        workspace: CarWorkspace | None = None,
    ) -> CarWorld:
        """Prepare a snapshot; the other arguments are those of the planner that asks."""
        workspace = workspace or CarWorkspace()
        rules = GridPlannerParameters(cost_factor=cost_factor, allow_unknown=allow_unknown)
        outlines = (footprint.offset(spare * costmap.resolution) for spare in (0.0, *SPARE))
        samples, larger, slightly_larger = (FootprintCheck(one, costmap.resolution).samples for one in outlines)
        unknown = UNKNOWN_AS if allow_unknown else LETHAL
        grid = SearchGrid.build(costmap, rules, token, workspace.from_start)
        return cls(grid, footprint, samples, larger, slightly_larger, unknown, workspace)

    @property
    def costmap(self) -> Costmap:
        """The snapshot."""
        return self.grid.costmap

    def ground(self, *, roomy: bool = False) -> Ground:
        """Prepare footprint checks of many poses; ``roomy``: those with little room to spare cost more."""
        outlines = (self.samples, self.larger, self.slightly_larger) if roomy else (self.samples,)
        return self.workspace.ground(self.costmap, self.unknown, *outlines)

    def fits(self, pose: Pose) -> bool:
        """Whether the whole footprint lies on the map and off lethal cells, the centre off inscribed ones."""
        cost = pose_cost(self.costmap.cells, self.unknown, self.grid.geometry, self.samples, planar(pose))
        return bool(cost >= 0)

    def fits_between(self, poses: FloatArray) -> bool:
        """Whether the footprint touches nothing between poses (n, 3: x, y [m], yaw [rad]) of a drive, either.

        A corner of a cell may reach into the outline between two poses a cell apart; controllers look more often.
        """
        grid = self.costmap.cells, self.costmap.resolution, self.costmap.origin_x, self.costmap.origin_y
        return bool(first_collision(*grid, self.samples, dense(poses, BETWEEN_OF_A_CAR)) < 0)

    def leaves_map(self, pose: Pose) -> bool:
        """Whether a part of the footprint lies off the map."""
        return not bool(self.costmap.world_to_cells(self._placed(pose))[1].all())

    def _placed(self, pose: Pose) -> NDArray[np.float64]:
        """The samples (n, 2) [m] of the footprint at a pose."""
        c, s, (x, y) = math.cos(pose.yaw), math.sin(pose.yaw), self.samples.T
        return np.column_stack([pose.x + c * x - s * y, pose.y + s * x + c * y])

    def off_map_by(self, pose: Pose) -> float:
        """How far [m] the robot must move, without turning, until no part of its footprint lies off the map."""
        placed, grid = self._placed(pose), self.costmap
        low, high = placed.min(axis=0), placed.max(axis=0)
        beyond_x = max(grid.origin_x - low[0], high[0] - grid.upper_x, 0.0)
        return math.hypot(beyond_x, max(grid.origin_y - low[1], high[1] - grid.upper_y, 0.0))

    def reached(self, start: Pose, goal: Pose) -> tuple[bool, NDArray[np.float32]]:
        """Whether the centre gets from a pose's cell to another's, and (n,) costs [cells] of the padded grid's cells.

        Where the goal is reached, only the costs on the way are known.
        """
        grid, first, last = self.grid, self._cell(start), self._cell(goal)
        (records, buckets), touched = grid.memory(new_search_memory)
        status, g, _ = search(grid.padded, first, last, 1.0, True, False, grid.token.flag, records, touched, buckets)
        return status == FOUND, g

    def field(self, source: Pose) -> NDArray[np.float32]:
        """(n,) cost [cells] of all cells of the padded grid from a pose's cell around what blocks the centre."""
        grid, first = self.grid, self._cell(source)
        (records, buckets), touched = grid.memory(new_search_memory)
        return search(grid.padded, first, -1, 0.0, True, False, grid.token.flag, records, touched, buckets)[1]

    def cost_of_way(self, costs: NDArray[np.float32], goal: Pose) -> float:
        """Cost [cells] of the centre's way to a pose among the costs of ``reached`` or ``field``."""
        return float(costs[self._cell(goal)])

    def _cell(self, pose: Pose) -> int:
        """Flat padded index of a pose's cell."""
        return self.grid.index(self.grid.cell_of(pose))

    def drive(
        self, ground: Ground, car: Car, start: Pose, goal: Pose, wanted: Pose, tolerance: float, max_states: int
    ) -> tuple[int, FloatArray, float, int, FloatArray]:
        """Call ``hybrid_search`` with the fields of costs from both ends in the workspace's memory."""
        grid, workspace = self.grid, self.workspace
        memory = _field_memory(grid, workspace.from_start), _field_memory(grid, workspace.from_goal)
        ends, cells = (planar(start), planar(goal)), (self._cell(start), self._cell(goal))
        flag = grid.token.flag
        answer: tuple[int, FloatArray, float, int, FloatArray] = hybrid_search(
            ground, car, ends, cells, memory, planar(wanted), tolerance, max_states, flag
        )
        if flag[0] != 0:  # set while the records were written, it left some of them out
            for one in memory:
                one.touched[:] = whole_grid(grid.padded.cells, grid.padded.stride)
        return answer


def planar(pose: Pose) -> FloatArray:
    """(3,) x, y [m], yaw [rad]."""
    return np.array([pose.x, pose.y, pose.yaw])


def _field_memory(grid: SearchGrid, workspace: SearchWorkspace) -> FieldMemory:
    """The workspace's memory for a field over a grid."""
    (records, buckets), touched = workspace.memory(grid.padded, new_search_memory)
    shape = -1, grid.padded.stride
    words = records.view(np.uint64).reshape(shape)
    return FieldMemory(grid.padded.cells.reshape(shape), words, records, grid.padded.table, buckets, touched)
