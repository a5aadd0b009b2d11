"""Speed-limit layer: areas where the robot must drive slowly, from polygons and from a mask image.

When to use: ramps, crossings, places with people. When not: to keep the robot out, use the keep-out layer. Cost: no
cells at all; one look-up per question. Known failure: the limit applies from the moment the robot's centre is inside,
so draw an area with the distance the robot needs to brake.

It writes no costs; ``LayeredCostmap.speed_limit`` queries it. A zone's ``speed_limit`` is a speed [m/s], or a share of
the full speed [%] with ``limit_type: percent``. In a mask, limit = ``base`` + ``multiplier`` * occupancy (0..100); free
and unknown mask cells set no limit (Nav2's speed filter).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_description import UNKNOWN_OCCUPANCY
from mbf_costmap_nav.files.map_io import load_map
from mbf_costmap_nav.grid.costmap import FREE, CellArray, CellBox, Costmap
from mbf_costmap_nav.grid.placement import Placement
from mbf_costmap_nav.grid.zones import Zone, load_zones
from mbf_costmap_nav.map.layer import CostmapLayer, LayerContext


class SpeedLimitLayerParameters(LayerParameters):
    """Parameters of the speed-limit layer."""

    zones: tuple[Zone, ...] = parameter((), "Polygons written in place.", dynamic=False)
    zones_file: str = parameter("", "YAML file with more polygons.", dynamic=False)
    mask_file: str = parameter("", "map_server YAML file of a mask image.", dynamic=False)
    map_frame: str = parameter("", "Frame of zones and mask; empty = the costmap's.", dynamic=False)
    limit_type: Literal["absolute", "percent"] = parameter("absolute", "Whether limits are m/s or % of full speed.")
    base: float = parameter(100.0, "Limit of a mask cell of occupancy 0, in the unit of limit_type.")
    multiplier: float = parameter(-1.0, "Change of the limit per point of occupancy.")


class SpeedLimitLayer(CostmapLayer):
    """Slow areas. See the module's text for when to use it."""

    Parameters = SpeedLimitLayerParameters
    clearable = False
    parameters: SpeedLimitLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        files = self.parameters
        self._zones = files.zones + (load_zones(context.base_folder / files.zones_file) if files.zones_file else ())
        self._mask: Costmap | None = None
        if files.mask_file:
            mask_file = context.base_folder / files.mask_file
            mask = load_map(mask_file, context.max_cells, confined=context.confine_images).axis_aligned(
                context.max_cells
            )
            self._mask = Costmap(mask.occupancy, mask.resolution, mask.origin[0], mask.origin[1], context.frame_id)
        self._placement = Placement(files.map_frame, context)

    @property
    def permanent(self) -> bool:
        """Always true: it changes no cell."""
        return True

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Look up the transform of the areas; they change no cell."""
        self._placement.refresh()
        return box

    def stale_reason(self, now: float) -> str:
        """Why the areas cannot be placed: their frame is unknown."""
        return self._placement.problem

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Write nothing: a limit is no cost."""

    def speed_limit(self, x: float, y: float, full_speed: float) -> float:
        """Allowed speed [m/s] at the point (x, y) [m], at most ``full_speed``."""
        x, y = self._placement.to_data(np.array([[x, y]]))[0].tolist()
        limits = [zone.speed_limit for zone in self._zones if zone.speed_limit is not None and zone.contains(x, y)]
        occupancy = self._mask.cost_at(x, y) if self._mask is not None else None
        if occupancy is not None and occupancy not in (FREE, UNKNOWN_OCCUPANCY):
            limits.append(max(0.0, self.parameters.base + self.parameters.multiplier * occupancy))
        scale = full_speed / 100.0 if self.parameters.limit_type == "percent" else 1.0
        return min([full_speed, *(limit * scale for limit in limits)])
