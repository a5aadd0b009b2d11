"""Keep-out layer: areas the robot must not enter, from polygons and from a mask image.

When to use: stairs, glass doors, places that are free but forbidden; list it before the inflation layer if the whole
robot must stay out, after it if only the robot's centre must. When not: for areas that are only undesirable paint grey
in the mask, or use the speed-limit layer. Cost: nothing after the first update, one refill when a rolling window moves.
Known failure: a robot that stands inside such an area finds no plan; the escape recovery leads out.

Every cell a polygon touches is lethal. A mask's occupancy raises costs in proportion (as Nav2's keep-out filter);
free and unknown parts of a mask have no effect. Of a mask finer than the map the highest cost in a cell counts, so that
a line one pixel wide is effective.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, FREE, LETHAL, UNKNOWN, CellArray, CellBox, GridGeometry
from mbf_costmap_nav.grid.resampling import sample_costmap
from mbf_costmap_nav.grid.zones import Zone
from mbf_costmap_nav.kernels.map.rasterisation import fill_polygon
from mbf_costmap_nav.map.area_layer import AreaLayer, AreaLayerParameters
from mbf_costmap_nav.map.layer import CombinationMethod, LayerContext, combine


class KeepoutLayerParameters(AreaLayerParameters):
    """Parameters of the keep-out layer."""


class KeepoutLayer(AreaLayer):
    """Forbidden areas. See the module's text for when to use it."""

    Parameters = KeepoutLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._costs = self.mask.to_costmap(context.frame_id) if self.mask is not None else None
        self._changed = EMPTY_BOX

    def zone_warning(self, zone: Zone) -> str:
        """A limit: nothing drives here."""
        return "" if zone.speed_limit is None else "speed_limit has no effect in a keep-out layer"

    def lethal_reason(self, x: float, y: float) -> str:
        """The zone there, or the mask."""
        if not self.placement.known:
            return ""
        there = self.placement.to_data(np.array([[x, y]]))[0].tolist()
        for index, zone in enumerate(self.zones):
            if zone.contains(*there):
                return f"zone {zone.title('zones', index)}"
        return "the mask" if self._costs is not None else "the edge of a zone"

    @property
    def permanent(self) -> bool:
        """Whether its areas are in the costmap's frame."""
        return self.placement.in_costmap_frame

    def parameters_changed(self) -> None:
        """Paint the zones as they are now."""
        self._paint()

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Paint the areas onto the grid."""
        super().match_geometry(geometry)
        self._paint()

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Paint again at the window's new position."""
        super().shift(geometry, dx, dy)
        self._paint()

    def _paint(self) -> None:
        grid = self.geometry
        self.cells: CellArray = np.full((grid.height, grid.width), UNKNOWN, dtype=np.uint8)
        if not self.placement.known:
            return
        if self._costs is not None:
            self.cells[:] = sample_costmap(self._costs, grid, grid.box, UNKNOWN, self.placement.T_data_costmap)
            self.cells[self.cells == FREE] = UNKNOWN
        for zone in self.zones:
            corners = self.placement.to_costmap(zone.corners) - (grid.origin_x, grid.origin_y)
            fill_polygon(self.cells, corners / grid.resolution, LETHAL)
        self._changed = grid.box

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Report everything once after painting."""
        if self.placement.refresh():
            self._paint()
        changed, self._changed = self._changed, EMPTY_BOX
        return box.union(changed)

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Raise costs to those of the areas."""
        combine(cells, self.cells, box, CombinationMethod.MAXIMUM)
