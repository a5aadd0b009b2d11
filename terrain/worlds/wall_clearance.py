"""How far one can walk between the walls of a building."""

from __future__ import annotations

import math

from scipy import ndimage

from terrain.worlds.occupancy import OccupancyGrid

STEP = 0.02  # m; the least step of a look along a direction


class Walls:
    """How far one can walk between the walls of a building."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self._grid = grid
        self._clearance = ndimage.distance_transform_edt(~grid.occupied) * grid.resolution

    def clearance(self, x: float, y: float) -> float:
        """Distance [m] from the cell at (x, y) to the nearest occupied one; inf outside of the map."""
        ix = math.floor((x - self._grid.origin_x) / self._grid.resolution)
        iy = math.floor((y - self._grid.origin_y) / self._grid.resolution)
        ny, nx = self._clearance.shape
        return float(self._clearance[iy, ix]) if 0 <= ix < nx and 0 <= iy < ny else math.inf

    def free_distance(self, x: float, y: float, ux: float, uy: float, radius: float, limit: float) -> float:
        """How far [m] a circle can move from (x, y) in the direction (ux, uy), at most ``limit``.

        Each step is as long as the clearance allows. Who is too near to a wall already may move away from it.
        """
        along, least = 0.0, min(radius, self.clearance(x, y))
        while along < limit:
            room = self.clearance(x + along * ux, y + along * uy) - least
            if room < 0.0:
                return max(0.0, along - STEP)
            along += max(room, STEP)
        return limit
