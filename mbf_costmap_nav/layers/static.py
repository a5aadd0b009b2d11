"""Static layer: the map of a file (or one handed over by the program) under everything else.

When to use: first in the list of a global map; also in a rolling local map, where it is sampled at the window's cells.
When not: for areas a robot must not enter although they are free, use a keep-out layer, which stays when the map is
replaced. Cost: nothing after the first update, as its cells never change by themselves; in a rolling map one copy of
the window for each move by a cell. Known failure: furniture moves; combine it with a sensor layer.

The map may be given in another frame (``map_frame``), for example under a local costmap in odom: it is then placed
by the newest transform, and again whenever that changes. While the transform is unknown the layer holds nothing
and the costmap is not current. The interpretation of values is costmap_2d's static layer with ``trinary_costmap`` off;
map files in trinary mode give the same result as with it on.
"""

from __future__ import annotations

import numpy as np

from mbf_abstract.config.bounded_files import named_file
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_io import load_costmap
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, LETHAL, UNKNOWN, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.placement import Placement
from mbf_costmap_nav.grid.resampling import sample_costmap
from mbf_costmap_nav.map.layer import CombinationMethod, GridLayer, LayerContext, combine


class StaticLayerParameters(LayerParameters):
    """Parameters of the static layer."""

    map_file: str = parameter(
        "", "map_server YAML file or image, relative to the configuration's folder.", dynamic=False
    )
    map_frame: str = parameter("", "Frame of the map file's origin; empty = the costmap's.", dynamic=False)
    use_maximum: bool = parameter(False, "Combine by the larger cost instead of replacing what is below.")


LETHAL_SHARE = 0.95
"""A map with a greater share of occupied cells is probably misconfigured."""


class StaticLayer(GridLayer):
    """A fixed map. See the module's text for when to use it."""

    Parameters = StaticLayerParameters
    clearable = False
    parameters: StaticLayerParameters

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        if self.parameters.map_file:
            self._map = load_costmap(
                named_file(context.base_folder, self.parameters.map_file),
                self.parameters.map_frame or context.frame_id,
                context.track_unknown_space,
                confined=context.confine_images,
                max_cells=context.max_cells,
            )
        elif context.static_map is not None:
            self._map = context.static_map
        else:
            raise ValueError(f"static layer {context.name!r} needs map_file, or a map handed over by the program")
        self._changed = EMPTY_BOX
        self._placement = Placement(self._map.frame_id, context)

    @property
    def permanent(self) -> bool:
        """Whether its map is in the costmap's frame."""
        return self._placement.in_costmap_frame

    @property
    def floor_plan(self) -> Costmap:
        """The map as loaded."""
        return self._map

    def configuration_warning(self) -> str:
        """Warn that nearly all of the map is occupied."""
        known = self._map.cells != UNKNOWN
        share = float(np.sum(self._map.cells == LETHAL)) / max(int(np.sum(known)), 1)
        if share < LETHAL_SHARE:
            return ""
        return (
            f"{share:.0%} of the known cells are occupied, so hardly anything can be planned; see negate and thresholds"
        )

    @property
    def default_value(self) -> int:
        """Cells outside the map hold no information, however unknown cells inside it are treated."""
        return UNKNOWN

    def preferred_geometry(self) -> GridGeometry | None:
        """Grid of the map, unless it is in another frame."""
        return self._map.geometry if self._placement.in_costmap_frame else None

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Sample the map at the costmap's cells."""
        super().match_geometry(geometry)
        self._sample(geometry.box)
        self._changed = geometry.box

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Move the window over the map and sample what came into view."""
        super().shift(geometry, dx, dy)
        box = geometry.box
        self._sample(CellBox(box.x1 - dx, 0, box.x1, box.y1) if dx > 0 else CellBox(0, 0, -dx, box.y1))
        self._sample(CellBox(0, box.y1 - dy, box.x1, box.y1) if dy > 0 else CellBox(0, 0, box.x1, -dy))

    def _sample(self, box: CellBox) -> None:
        """Take each cell's value from the map, without losing obstacles; nothing while the map cannot be placed."""
        box = box.clipped(self.geometry.box)
        if self._placement.known:
            self.cells[box.slices] = sample_costmap(
                self._map, self.geometry, box, self.default_value, self._placement.T_data_costmap
            )

    def stale_reason(self, now: float) -> str:
        """Why the map cannot be placed: its frame is unknown."""
        return self._placement.problem

    def reset(self) -> None:
        """Return to the map as loaded, undoing cleared areas."""
        self.match_geometry(self.geometry)

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Report the whole map once after sampling it."""
        if self._placement.refresh():
            self.match_geometry(self.geometry)
        changed, self._changed = self._changed, EMPTY_BOX
        return box.union(changed)

    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Write the map; unknown cells of it leave what is below."""
        method = CombinationMethod.MAXIMUM if self.parameters.use_maximum else CombinationMethod.OVERWRITE
        combine(cells, self.cells, box, method)
