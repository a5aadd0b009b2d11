"""The base of layers made of areas: polygons and a mask image, in the costmap's frame or another one.

When to use: for areas that people draw, as forbidden or slow ones. When not: for what sensors see.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_io import load_map
from mbf_costmap_nav.grid.placement import Placement
from mbf_costmap_nav.grid.zones import Zone, load_zones
from mbf_costmap_nav.map.layer import CostmapLayer, LayerContext


class AreaLayerParameters(LayerParameters):
    """Where the areas of a layer come from."""

    zones: tuple[Zone, ...] = parameter((), "Polygons written in place; those of the file stay when they change.")
    zones_file: str = parameter("", "YAML file with more polygons.", dynamic=False, reads_file=True)
    mask_file: str = parameter("", "map_server YAML file of a mask image.", dynamic=False, reads_file=True)
    map_frame: str = parameter("", "Frame of zones and mask; empty = the costmap's.", dynamic=False)


class AreaLayer(CostmapLayer):
    """Areas that clearing the costmap does not remove.

    Attributes
    ----------
    mask : OccupancyMap or None
        Content of the mask image, with axes parallel to its frame.
    placement : Placement
        Where zones and mask lie on the costmap.
    """

    draws_areas = True
    parameters: AreaLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        p, folder, limit = self.parameters, context.base_folder, context.max_cells
        self._zones_of_file = load_zones(configured_file(folder, p.zones_file)) if p.zones_file else ()
        self.mask = None
        if p.mask_file:
            mask_file = configured_file(folder, p.mask_file)
            self.mask = load_map(mask_file, limit, confined=context.confine_images).axis_aligned(limit)
        self.placement = Placement(p.map_frame, context)

    @property
    def zones(self) -> tuple[Zone, ...]:
        """Polygons of the configuration, as they are now, and of the zones file."""
        return self.parameters.zones + self._zones_of_file

    def configuration_warning(self) -> str:
        """The first zone that is hardly meant as it is: its polygon, its limit, or its place."""
        for index, zone in enumerate(self.zones):
            if problem := zone.warning() or self.zone_warning(zone) or self._off_grid(zone):
                return f"zone {zone.title('zones', index)}: {problem}"
        return ""

    def zone_warning(self, zone: Zone) -> str:
        """What of a zone has no effect in this layer; empty if all of it has."""
        return ""

    def _off_grid(self, zone: Zone) -> str:
        if self.rolling_window or not self.placement.known:
            return ""
        corners, grid = self.placement.to_costmap(zone.corners), self.geometry
        low = np.array([grid.origin_x, grid.origin_y])
        high = low + grid.resolution * np.array([grid.width, grid.height])
        beside = (corners.max(axis=0) <= low) | (corners.min(axis=0) >= high)
        return "it lies outside of the map" if beside.any() else ""

    def stale_reason(self, now: float) -> str:
        """Why the areas cannot be placed: their frame is unknown."""
        return self.placement.problem
