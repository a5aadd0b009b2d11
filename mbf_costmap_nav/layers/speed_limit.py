"""Speed-limit layer: areas where the robot must drive slowly, from polygons and from a mask image.

When to use: ramps, crossings, places with people. When not: to keep the robot out, use the keep-out layer. Cost: no
cells at all; one look-up per question. Known failure: the limit applies from the moment the robot's centre is inside,
so draw an area with the distance the robot needs to brake.

It writes no costs; ``LayeredCostmap.speed_limit`` queries it, and whatever drives is slowed down, see
``mbf_abstract.maps.layers.obeyed_limits``. A limit of 0 m/s is none that can be driven at: paths through it are
blocked.

A zone's ``speed_limit`` is a speed [m/s], or a share of the full speed [%] with ``limit_type: percent``. In a mask,
limit = ``base`` + ``multiplier`` * occupancy (0..100); free and unknown mask cells set no limit (Nav2's speed filter).
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.limits import LimitType, limit_warning, lowest
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_description import UNKNOWN_OCCUPANCY
from mbf_costmap_nav.grid.costmap import FREE, CellArray, CellBox, Costmap
from mbf_costmap_nav.grid.zones import Zone
from mbf_costmap_nav.map.area_layer import AreaLayer, AreaLayerParameters
from mbf_costmap_nav.map.layer import LayerContext


class SpeedLimitLayerParameters(AreaLayerParameters):
    """Parameters of the speed-limit layer."""

    limit_type: LimitType = parameter("absolute", "Whether limits are m/s or % of full speed.")
    base: float = parameter(100.0, "Limit of a mask cell of occupancy 0, in the unit of limit_type.")
    multiplier: float = parameter(-1.0, "Change of the limit per point of occupancy.")


class SpeedLimitLayer(AreaLayer):
    """Slow areas. See the module's text for when to use it."""

    Parameters = SpeedLimitLayerParameters
    parameters: SpeedLimitLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._limits: Costmap | None = None
        if (mask := self.mask) is not None:
            self._limits = Costmap(mask.occupancy, mask.resolution, *mask.origin[:2], context.frame_id)

    def zone_warning(self, zone: Zone) -> str:
        """No limit, or one that is none."""
        if zone.speed_limit is None:
            return "it has no speed_limit, so it does nothing"
        return limit_warning(zone.speed_limit, self.parameters.limit_type)

    @property
    def permanent(self) -> bool:
        """Always true: it changes no cell."""
        return True

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Look up the transform of the areas; they change no cell."""
        self.placement.refresh()
        return box

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Write nothing: a limit is no cost."""

    def speed_limit(self, x: float, y: float, full_speed: float) -> float:
        """Allowed speed [m/s] at the point (x, y) [m], at most ``full_speed``."""
        x, y = self.placement.to_data(np.array([[x, y]]))[0].tolist()
        limits = [zone.speed_limit for zone in self.zones if zone.speed_limit is not None and zone.contains(x, y)]
        occupancy = self._limits.cost_at(x, y) if self._limits is not None else None
        if occupancy is not None and occupancy not in (FREE, UNKNOWN_OCCUPANCY):
            limits.append(max(0.0, self.parameters.base + self.parameters.multiplier * occupancy))
        return lowest(limits, self.parameters.limit_type, full_speed)
