"""Searches for what a car can drive between two poses on one snapshot, with its whole outline.

When to use: by ``costmap.hybrid_astar``, and by ``manoeuvres`` for pieces of other planners' paths. When not: robots
that fit everywhere at every heading; a search over cells is 10 to 100 times faster.

Bins of two cells come first, for an eighth of the states; then finer ones, for tight places. After a long search that
finds nothing it is looked whether any way to the goal is as wide as the robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.kernels.car.ground import Ground
from mbf_costmap_nav.kernels.car.hybrid_astar import GAVE_UP
from mbf_costmap_nav.kernels.car.joints import HEADINGS
from mbf_costmap_nav.kernels.car.motion_primitives import Car
from mbf_costmap_nav.kernels.car.shorter_drive import shortened
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, FOUND
from mbf_costmap_nav.planning.car_world import CarWorld
from mbf_costmap_nav.planning.widest_disc import disc_gets_there

FloatArray = NDArray[np.float64]

CELLS_OF_BINS = (2.0, 1.0, 0.5, 0.25)
"""Sides [cells] of the bins, in the order in which they are tried."""
STATES_THAT_SHOW = 20_000
"""After so many states in bins of a cell or less finer ones are not tried: there is no path."""
TOO_WIDE = 5
"""Further state of a finished search: no way to the goal is as wide as the robot; a state near by may be reached."""


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
    """Result of a search between two poses: ``status`` of the kernel or TOO_WIDE, and poses (n, 3).

    Without poses there is no path. The cost [m] is weighted; ``states`` were made.
    """

    status: int
    poses: FloatArray
    cost: float
    states: int


def search_drive(
    world: CarWorld,
    driving: Driving,
    start: Pose,
    goal: Pose,
    *,
    wanted: Pose | None = None,
    tolerance: float = 0.0,
    bins: tuple[float, ...] = CELLS_OF_BINS,
    ground: Ground | None = None,
) -> CarLeg:
    """Search from a start to a goal at which the robot fits; finer and finer until there is a path.

    Parameters
    ----------
    wanted : Pose, optional
        If the goal is not reached, a state at most ``tolerance`` [m] from this pose, and of its heading, will do.
    bins : tuple of float
        Sides of the bins [cells] to try in order.
    ground : Ground, optional
        ``world.ground()``, where it is known already.
    """
    wanted = goal if wanted is None else wanted
    ground = world.ground() if ground is None else ground
    states = made = 0
    for cells in bins:
        if cells < 1.0 and made > STATES_THAT_SHOW:
            break
        car = driving.car(world.costmap.resolution, cells)
        status, poses, cost, made = world.drive(ground, car, start, goal, wanted, tolerance, driving.max_states)
        states += made
        if status not in (FOUND, CANCELED) and made > STATES_THAT_SHOW:
            around = 0.0 if len(poses) else tolerance
            if not disc_gets_there(world.costmap, world.footprint, start, wanted, around):
                status = TOO_WIDE
        if status in (FOUND, GAVE_UP, CANCELED, TOO_WIDE):
            break
    if status == FOUND:
        poses, cost = shortened(ground, car, poses, world.grid.token.flag)
    return CarLeg(status, poses, cost, states)
