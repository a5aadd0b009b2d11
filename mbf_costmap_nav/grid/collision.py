"""The cells under the robot's footprint at a pose: the oriented collision check of controllers, recoveries and queries.

When to use: for single poses and short motions. The check is exact (``kernels.map.footprint_cost``) and costs a few
microseconds plus about 2 ns a covered cell. When not: in a planner's inner loop compare the cell of the centre with
``INSCRIBED`` first, which decides most poses; for a batch of trajectories call the kernels directly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.queries import CellState
from mbf_costmap_nav.grid.costmap import INSCRIBED, LETHAL, UNKNOWN, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.rasterisation import polygon_costs


class FootprintCosts(NamedTuple):
    """Summary of the cells under a footprint, each counted once.

    Attributes
    ----------
    covered : int
        Number of cells; -1 if a corner of the footprint lies outside the map (all else is 0 then).
    lethal, inscribed, unknown : int
        How many of them are 254, 253, 255.
    rest : int
        Sum of all other costs.
    highest : int
        Largest known cost.
    """

    covered: int
    lethal: int
    inscribed: int
    unknown: int
    rest: int
    highest: int

    @property
    def state(self) -> CellState:
        """Worst state among the cells; unknown counts as worse than lethal (MBF)."""
        if self.covered < 0:
            return CellState.OUTSIDE
        return CellState.UNKNOWN if self.unknown else self.known

    @property
    def known(self) -> CellState:
        """Worst state among the cells that are known; FREE if none is."""
        if self.lethal:
            return CellState.LETHAL
        return CellState.INSCRIBED if self.inscribed else CellState.FREE

    def weighted_sum(self, lethal: float = 1.0, inscribed: float = 1.0, unknown: float = 1.0) -> float:
        """Sum of the costs, with factors for the three special values."""
        return (
            self.rest
            + lethal * LETHAL * self.lethal
            + inscribed * INSCRIBED * self.inscribed
            + unknown * UNKNOWN * self.unknown
        )


def footprint_costs(costmap: Costmap, footprint: Footprint, x: float, y: float, yaw: float) -> FootprintCosts:
    """Look up all cells under a footprint.

    Parameters
    ----------
    footprint : Footprint
        With fewer than three points only the cell of the centre counts.
    x, y, yaw : float
        Pose of the base [m, m, rad] in the costmap's frame.
    """
    return FootprintCosts(*polygon_costs(costmap.cells, corners_in_cells(costmap, footprint, x, y, yaw)))


def corners_in_cells(costmap: Costmap, footprint: Footprint, x: float, y: float, yaw: float) -> NDArray[np.float64]:
    """Corners (n, 2) float64 [cells] of a footprint at a pose x, y [m], yaw [rad] of the costmap's frame."""
    corners = footprint.at(x, y, yaw) if len(footprint.vertices) >= 3 else np.array([[x, y]])
    return np.asarray(np.subtract(corners, (costmap.origin_x, costmap.origin_y)) / costmap.resolution)
