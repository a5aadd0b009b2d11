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
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_io import load_costmap
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, FREE, LETHAL, UNKNOWN, CellArray, CellBox, GridGeometry
from mbf_costmap_nav.grid.placement import Placement
from mbf_costmap_nav.grid.resampling import sample_costmap
from mbf_costmap_nav.grid.zones import Zone, load_zones
from mbf_costmap_nav.kernels.map.footprint_samples import fill_polygon
from mbf_costmap_nav.map.layer import CombinationMethod, CostmapLayer, LayerContext, combine


class KeepoutLayerParameters(LayerParameters):
    """Parameters of the keep-out layer."""

    zones: tuple[Zone, ...] = parameter((), "Polygons written in place.", dynamic=False)
    zones_file: str = parameter("", "YAML file with more polygons.", dynamic=False)
    mask_file: str = parameter("", "map_server YAML file of a mask image.", dynamic=False)
    map_frame: str = parameter("", "Frame of zones and mask; empty = the costmap's.", dynamic=False)


class KeepoutLayer(CostmapLayer):
    """Forbidden areas; clearing the costmap does not remove them. See the module's text for when to use it."""

    Parameters = KeepoutLayerParameters
    clearable = False
    parameters: KeepoutLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        files = self.parameters
        self._zones = files.zones + (load_zones(context.base_folder / files.zones_file) if files.zones_file else ())
        self._mask = None
        if files.mask_file:
            mask_file = context.base_folder / files.mask_file
            self._mask = load_costmap(
                mask_file, context.frame_id, confined=context.confine_images, max_cells=context.max_cells
            )
        self._placement = Placement(files.map_frame, context)
        self._changed = EMPTY_BOX

    @property
    def permanent(self) -> bool:
        """Whether its areas are in the costmap's frame."""
        return self._placement.in_costmap_frame

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
        if not self._placement.known:
            return
        if self._mask is not None:
            self.cells[:] = sample_costmap(self._mask, grid, grid.box, UNKNOWN, self._placement.T_data_costmap)
            self.cells[self.cells == FREE] = UNKNOWN
        for zone in self._zones:
            corners = self._placement.to_costmap(zone.corners) - (grid.origin_x, grid.origin_y)
            fill_polygon(self.cells, corners / grid.resolution, LETHAL)
        self._changed = grid.box

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Report everything once after painting."""
        if self._placement.refresh():
            self._paint()
        changed, self._changed = self._changed, EMPTY_BOX
        return box.union(changed)

    def stale_reason(self, now: float) -> str:
        """Why the areas cannot be placed: their frame is unknown."""
        return self._placement.problem

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Raise costs to those of the areas."""
        combine(cells, self.cells, box, CombinationMethod.MAXIMUM)
