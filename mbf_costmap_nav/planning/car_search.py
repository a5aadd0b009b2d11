"""Searches for what a car can drive between two poses on one snapshot, with its whole outline.

When to use: by ``costmap.hybrid_astar``, and by ``manoeuvres`` for pieces of other planners' paths. When not: robots
that fit everywhere at every heading; a search over cells is 10 to 100 times faster.

Bins of two cells come first, for an eighth of the states; then finer ones, for tight places. After a long search that
finds nothing it is looked whether any way to the goal is wide enough for the robot. ``search_plan`` shares the states
that a plan may cost among the sizes of the bins: where a car gets round a corner that hardly lets it pass, small bins
show it with few states, however many large ones a search of the rooms before and behind it would take.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.kernels.car.ground import Ground
from mbf_costmap_nav.kernels.car.hybrid_astar import GAVE_UP
from mbf_costmap_nav.kernels.car.joints import HEADINGS
from mbf_costmap_nav.kernels.car.motion_primitives import Car
from mbf_costmap_nav.kernels.car.shorter_drive import shortened
from mbf_costmap_nav.kernels.search.grid_search import CANCELED, EXHAUSTED, FOUND
from mbf_costmap_nav.planning.car_world import CarWorld
from mbf_costmap_nav.planning.passage import TooNarrow, too_narrow

FloatArray = NDArray[np.float64]

CELLS_OF_BINS = (2.0, 1.0, 0.5, 0.25)
"""Sides [cells] of the bins, in the order in which they are tried."""
STATES_THAT_SHOW = 20_000
"""After so many states in bins of a cell or less finer ones are not tried: there is no path."""
TOO_WIDE = 5
"""Further state of a finished search: no way to the goal is wide enough for the robot; a state near by may be
reached."""
LEAST_STATES, STATES_PER_CELL = 600_000, 800
"""A plan may cost so many states by default, or so many for each cell of the way of the centre alone."""
ROOMY_SHARE, SHARE = 4, 6
"""A quarter of the states are for paths with some room to spare, a sixth for each size of the bins without."""


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

    Without poses there is no path. The cost [m] is weighted; ``states`` were made. Without a path it came as far as
    ``stuck`` (x, y) [m]. ``narrow``: why no way is wide enough. ``is_known``: whether that was asked.
    """

    status: int
    poses: FloatArray
    cost: float
    states: int
    stuck: tuple[float, float] = (0.0, 0.0)
    narrow: TooNarrow | None = None
    is_known: bool = False


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
    is_known: bool = False,
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
    is_known : bool
        Whether it is known that some way is wide enough.
    """
    wanted = goal if wanted is None else wanted
    ground = world.ground() if ground is None else ground
    states, made, narrow, places = 0, 0, None, []
    for cells in bins:
        if cells < 1.0 and made > STATES_THAT_SHOW:
            break
        car = driving.car(world.costmap.resolution, cells)
        status, poses, cost, made, stuck = world.drive(ground, car, start, goal, wanted, tolerance, driving.max_states)
        states += made
        places.append((float(stuck[0]), float(stuck[1])))  # small bins do not get far with their states
        if status not in (FOUND, CANCELED) and made > STATES_THAT_SHOW and not is_known:
            is_known, around = True, 0.0 if len(poses) else tolerance
            narrow = too_narrow(world.costmap, world.footprint, start, wanted, around)
            status = TOO_WIDE if narrow else status
        if status in (FOUND, GAVE_UP, CANCELED, TOO_WIDE):
            break
    if status == FOUND:
        poses, cost = shortened(ground, car, poses, world.grid.token.flag)
    return CarLeg(status, poses, cost, states, places[0], narrow, is_known)


def search_plan(
    world: CarWorld, driving: Driving, start: Pose, goal: Pose, *, wanted: Pose, tolerance: float
) -> CarLeg:
    """Search with room to spare, then without, in finer and finer bins; ``driving.max_states`` are for all of them.

    A path that touches something between its poses is returned only where no other was found.
    The other arguments are those of ``search_drive``.
    """
    limit = driving.max_states
    tries: list[tuple[int, tuple[float, ...], Ground]]
    tries = [(limit // ROOMY_SHARE, CELLS_OF_BINS, world.ground(roomy=True))]
    # The dearer poses change which states a bin keeps, so a passage hardly wider than the robot may be missed.
    tries += [(limit // SHARE, (cells,), world.ground()) for cells in CELLS_OF_BINS]
    leg, states = CarLeg(EXHAUSTED, np.empty((0, 3)), 0.0, 0), 0
    for share, bins, ground in tries:
        fewer, before = replace(driving, max_states=max(share, 1)), leg
        leg = search_drive(
            world,
            fewer,
            start,
            goal,
            wanted=wanted,
            tolerance=tolerance,
            bins=bins,
            ground=ground,
            is_known=before.is_known or len(before.poses) > 0,
        )
        leg, states = replace(leg, stuck=before.stuck if states else leg.stuck), states + leg.states
        if leg.status in (CANCELED, TOO_WIDE) or (leg.status == FOUND and world.fits_between(leg.poses)):
            break
        if len(before.poses) and not len(leg.poses):
            leg = replace(leg, status=before.status, poses=before.poses, cost=before.cost)
        elif before.status == GAVE_UP and not len(leg.poses):
            leg = replace(leg, status=GAVE_UP)
        if bins == (1.0,) and leg.status == EXHAUSTED and leg.states > STATES_THAT_SHOW:
            break
    if leg.status == EXHAUSTED and not leg.is_known:
        leg = replace(leg, narrow=too_narrow(world.costmap, world.footprint, start, wanted, tolerance))
    return replace(leg, states=states)
