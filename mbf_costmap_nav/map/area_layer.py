"""The base of layers made of areas: polygons and a mask image, in the costmap's frame or another one.

When to use: for areas that people draw, as forbidden or slow ones. When not: for what sensors see.
"""

from __future__ import annotations

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_io import load_map
from mbf_costmap_nav.grid.placement import Placement
from mbf_costmap_nav.grid.zones import Zone, load_zones
from mbf_costmap_nav.map.layer import CostmapLayer, LayerContext


class AreaLayerParameters(LayerParameters):
    """Where the areas of a layer come from."""

    zones: tuple[Zone, ...] = parameter((), "Polygons written in place.", dynamic=False)
    zones_file: str = parameter("", "YAML file with more polygons.", dynamic=False)
    mask_file: str = parameter("", "map_server YAML file of a mask image.", dynamic=False)
    map_frame: str = parameter("", "Frame of zones and mask; empty = the costmap's.", dynamic=False)


class AreaLayer(CostmapLayer):
    """Areas that clearing the costmap does not remove.

    Attributes
    ----------
    zones : tuple of Zone
        Polygons of the configuration and of the zones file.
    mask : OccupancyMap or None
        Content of the mask image, with axes parallel to its frame.
    placement : Placement
        Where zones and mask lie on the costmap.
    """

    parameters: AreaLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        p, folder, limit = self.parameters, context.base_folder, context.max_cells
        self.zones = p.zones + (load_zones(configured_file(folder, p.zones_file)) if p.zones_file else ())
        self.mask = None
        if p.mask_file:
            mask_file = configured_file(folder, p.mask_file)
            self.mask = load_map(mask_file, limit, confined=context.confine_images).axis_aligned(limit)
        self.placement = Placement(p.map_frame, context)

    def stale_reason(self, now: float) -> str:
        """Why the areas cannot be placed: their frame is unknown."""
        return self.placement.problem
