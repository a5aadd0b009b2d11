"""Layer `wet_floor`: a round place that is better avoided, e.g. a wet floor.

When to use: the place may be crossed if there is no other path. When not: it must not be entered; use `keepout`.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.grid.costmap import UNKNOWN, CellArray, CellBox
from mbf_costmap_nav.map.layer import CostmapLayer, LayerParameters


class WetFloorParameters(LayerParameters):
    """Parameters of `wet_floor`."""

    x: float = parameter(0.0, "X of the centre, in the costmap's frame.", unit="m")
    y: float = parameter(0.0, "Y of the centre.", unit="m")
    radius: float = parameter(0.5, "Radius of the place.", unit="m", gt=0.0)
    cost: int = parameter(200, "Cost of its cells; below 253, which is forbidden.", ge=1, le=252)


class WetFloor(CostmapLayer):
    """Raises the cells whose centre lies in the circle."""

    Parameters = WetFloorParameters
    parameters: WetFloorParameters

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Write the circle in every update."""
        x, y, radius = self.parameters.x, self.parameters.y, self.parameters.radius
        low = self.geometry.world_to_cell_clamped(x - radius, y - radius)
        high = self.geometry.world_to_cell_clamped(x + radius, y + radius)
        return box.union(CellBox(*low, high[0] + 1, high[1] + 1))

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Raise known cells of the circle to ``cost``; what is higher already stays."""
        ix, iy = np.meshgrid(np.arange(box.x0, box.x1), np.arange(box.y0, box.y1))
        x, y = self.geometry.cells_to_world(np.stack([ix, iy], axis=-1)).T
        inside = np.hypot(x - self.parameters.x, y - self.parameters.y).T <= self.parameters.radius
        part = cells[box.slices]
        part[inside & (part != UNKNOWN)] = np.maximum(part[inside & (part != UNKNOWN)], self.parameters.cost)
