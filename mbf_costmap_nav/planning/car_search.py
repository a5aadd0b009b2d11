"""Searches for what a car can drive between two poses on one snapshot, with its whole outline.

When to use: by ``costmap.hybrid_astar``, and by ``manoeuvres`` for pieces of other planners' paths. When not: robots
that fit everywhere at every heading; a search over cells is 10 to 100 times faster.

Bins of two cells come first, for an eighth of the states; then finer ones, for tight places.
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
from mbf_costmap_nav.kernels.car.hybrid_astar import GAVE_UP, hybrid_search
from mbf_costmap_nav.kernels.car.joints import HEADINGS, Target
from mbf_costmap_nav.kernels.car.motion_primitives import Car
from mbf_costmap_nav.kernels.car.shorter_drive import shortened
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, FOUND, search
from mbf_costmap_nav.planning.search_grid import GridPlannerParameters, SearchGrid

FloatArray = NDArray[np.float64]

UNKNOWN_AS = 252
"""Cost of the unknown cells that may be driven through, as for the other planners."""
SPARE = (0.5, 0.2)
"""Room [cells] around the outline that a path keeps where it can."""
CELLS_OF_BINS = (2.0, 1.0, 0.5, 0.25)
"""Sides [cells] of the bins, in the order in which they are tried."""
STATES_THAT_SHOW = 20_000
"""After so many states in bins of a cell or less finer ones are not tried: there is no path."""


@dataclass(frozen=True)
class Driving:
    """How the car drives, and what its search may cost.

    Attributes
    ----------
    radius : float
        Of the tightest curve [m].
    cost_factor : float
        Relative extra length of a path through cells of cost 252.
    reverse_penalty, turning_penalty : float
        Factors on the length driven backward, and on that of curves.
    change_penalty : float
        Of a change of direction [m].
    max_states : int
        The search gives up after so many.
    """

    radius: float
    reversing: bool
    cost_factor: float
    reverse_penalty: float
    change_penalty: float
    turning_penalty: float
    max_states: int

    def car(self, resolution: float, cells: float) -> Car:
        """The kinematic model for the search, with bins of so many cells."""
        # An arc leaves its bin, and turns by a bin of the headings at least; in fine bins, for tight places, by a part.
        step = max(1.5 * cells * resolution, min(1.0, cells) * 2.0 * math.pi / HEADINGS * self.radius)
        return Car(
            radius=self.radius,
            reversing=self.reversing,
            cost_factor=self.cost_factor,
            reverse_factor=self.reverse_penalty,
            turning_factor=self.turning_penalty,
            change_cost=self.change_penalty,
            bin_size=cells * resolution,
            step=step,
            pieces=math.ceil(step / resolution - 1e-9),
        )


@dataclass(frozen=True)
class CarLeg:
    """Result of a search between two poses: ``status`` of the kernel, and poses (n, 3); without them there is no path.

    The cost [m] is weighted; ``states`` were made.
    """

    status: int
    poses: FloatArray
    cost: float
    states: int


@dataclass(frozen=True)
class CarWorld:
    """One snapshot and the robot on it.

    Attributes
    ----------
    samples, larger, slightly_larger : (n, 2) float64
        Of the footprint [m], and of it with ``SPARE`` around it.
    unknown : int
        Cost of unknown cells.
    """

    grid: SearchGrid
    samples: FloatArray
    larger: FloatArray
    slightly_larger: FloatArray
    unknown: int

    @classmethod
    def build(
        cls, costmap: Costmap, footprint: Footprint, token: CancelToken, *, cost_factor: float, allow_unknown: bool
    ) -> CarWorld:
        """Prepare a snapshot; the other arguments are those of the planner that asks."""
        rules = GridPlannerParameters(cost_factor=cost_factor, allow_unknown=allow_unknown)
        outlines = (footprint.offset(spare * costmap.resolution) for spare in (0.0, *SPARE))
        samples, larger, slightly_larger = (FootprintCheck(one, costmap.resolution).samples for one in outlines)
        unknown = UNKNOWN_AS if allow_unknown else LETHAL
        return cls(SearchGrid.build(costmap, rules, token), samples, larger, slightly_larger, unknown)

    @property
    def costmap(self) -> Costmap:
        """The snapshot."""
        return self.grid.costmap

    def ground(self, *, roomy: bool = False) -> Ground:
        """Prepare footprint checks of many poses; ``roomy``: those with little room to spare cost more."""
        outlines = (self.samples, self.larger, self.slightly_larger) if roomy else (self.samples,)
        return ground_of(self.costmap.cells, self.unknown, self.grid.geometry, *outlines)

    def fits(self, pose: Pose) -> bool:
        """Whether the whole footprint lies on the map and off lethal cells, the centre off inscribed ones."""
        cost = pose_cost(self.costmap.cells, self.unknown, self.grid.geometry, self.samples, planar(pose))
        return bool(cost >= 0)

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

    def field(self, source: Pose) -> NDArray[np.float32]:
        """(n,) cost [cells] of the padded grid's cells from a pose's cell around what blocks the centre."""
        grid, first = self.grid, self.grid.index(self.grid.cell_of(source))
        _, g = search(grid.padded, first, -1, 0.0, True, False, grid.token.flag)
        return g

    def rows(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """(height, width) of a field, without the padding."""
        return field.reshape(-1, self.grid.padded.stride)[1:-1, 1:-1]


def search_drive(
    world: CarWorld,
    driving: Driving,
    start: Pose,
    goal: Pose,
    *,
    from_start: NDArray[np.float32] | None = None,
    wanted: Pose | None = None,
    tolerance: float = 0.0,
    bins: tuple[float, ...] = CELLS_OF_BINS,
    ground: Ground | None = None,
) -> CarLeg:
    """Search from a start to a goal at which the robot fits; finer and finer until there is a path.

    Parameters
    ----------
    from_start : (n,) float32, optional
        ``world.field(start)``, where it is known already.
    wanted : Pose, optional
        If the goal is not reached, a state at most ``tolerance`` [m] from this pose, and of its heading, will do.
    bins : tuple of float
        Sides of the bins [cells] to try in order.
    ground : Ground, optional
        ``world.ground()``, where it is known already.
    """
    grid, ends = world.grid, planar(goal if wanted is None else wanted)
    to_goal = Target(planar(goal), world.rows(world.field(goal)))
    to_start = Target(planar(start), world.rows(world.field(start) if from_start is None else from_start))
    ground = world.ground() if ground is None else ground
    states = made = 0
    for cells in bins:
        if cells < 1.0 and made > STATES_THAT_SHOW:
            break
        car = driving.car(world.costmap.resolution, cells)
        status, poses, cost, made = hybrid_search(
            ground, car, to_goal, to_start, ends, tolerance, driving.max_states, grid.token.flag
        )
        states += made
        if status in (FOUND, GAVE_UP, CANCELED):
            break
    if status == FOUND:
        poses, cost = shortened(ground, car, poses, grid.token.flag)
    return CarLeg(status, poses, cost, states)


def planar(pose: Pose) -> FloatArray:
    """(3,) x, y [m], yaw [rad]."""
    return np.array([pose.x, pose.y, pose.yaw])
