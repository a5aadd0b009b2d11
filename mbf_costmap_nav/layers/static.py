"""Static layer: the map of a file, a topic or the program under everything else.

When to use: first in the list of a global map; also in a rolling local map, where it is sampled at the window's cells.
When not: for areas a robot must not enter although they are free, use a keep-out layer, which stays when the map is
replaced. Cost: nothing after the first update, as its cells never change by themselves; in a rolling map one copy of
the window for each move by a cell. Known failure: furniture moves; combine it with a sensor layer.

The map may be given in another frame (``map_frame``), for example under a local costmap in odom: it is then placed
by the newest transform, and again whenever that changes. While the transform is unknown the layer holds nothing
and the costmap is not current.

With ``map_topic`` the map comes while the server runs, from a SLAM or a map server; in its header's frame, and the grid
of a costmap that does not roll becomes that of the map. Until the first one has come nothing can be planned, unless
there is a ``map_file``, too; nor is there a plan while the frame of the map that has come is unknown. What sensors have
marked is kept where only the values of cells change; on another grid only their newest scans are. As such a map may
change, no goal counts as unreachable for ever because of it.

The interpretation of values is that of costmap_2d's static layer, but ``trinary_costmap`` is off by default; map files
in trinary mode give the same result either way.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from mbf_abstract.config.bounded_files import configured_file
from mbf_abstract.geometry import Pose
from mbf_abstract.maps.layers.layer import LayerParameters
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_abstract.parameters import parameter
from mbf_costmap_nav.files.map_description import OCCUPIED
from mbf_costmap_nav.files.map_io import OccupancyMap, load_map
from mbf_costmap_nav.grid.costmap import EMPTY_BOX, LETHAL, UNKNOWN, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.placement import Placement
from mbf_costmap_nav.grid.resampling import sample_costmap
from mbf_costmap_nav.grid.rotated_map import axis_aligned_shape
from mbf_costmap_nav.map.layer import CombinationMethod, GridLayer, LayerContext, combine


class StaticLayerParameters(LayerParameters):
    """Parameters of the static layer."""

    map_file: str = parameter(
        "", "map_server YAML file or image, relative to the configuration's folder.", dynamic=False, reads_file=True
    )
    map_frame: str = parameter("", "Frame of the map file's origin; empty = the costmap's.", dynamic=False)
    map_topic: str = parameter(
        "", "Topic of a nav_msgs/OccupancyGrid that is or replaces the map, e.g. /map.", dynamic=False
    )
    lethal_cost_threshold: int = parameter(
        OCCUPIED, "Occupancy in percent from which on a cell is an obstacle.", ge=1, le=OCCUPIED, dynamic=False
    )
    trinary_costmap: bool = parameter(
        False, "Whether what lies below the threshold is free instead of a cost in proportion.", dynamic=False
    )
    use_maximum: bool = parameter(False, "Combine by the larger cost instead of replacing what is below.")


LETHAL_SHARE = 0.95
"""A map with a greater share of occupied cells is probably misconfigured."""


class StaticLayer(GridLayer):
    """A map of what stands. See the module's text for when to use it."""

    Parameters = StaticLayerParameters
    clearable = False
    parameters: StaticLayerParameters
    marks_obstacles = True
    """It belongs before an inflation layer."""

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context)
        self._context = context
        self._map = self._first_map()
        self._floor: FloorMap | None = None  # the last one that has come
        self._waiting: deque[FloorMap] = deque(maxlen=1)
        self._changed = EMPTY_BOX
        self._placement = Placement("" if self._map is None else self._map.frame_id, context)

    def _first_map(self) -> Costmap | None:
        context, p = self._context, self.parameters
        if p.map_file:
            file, frame_id = configured_file(context.base_folder, p.map_file), p.map_frame or context.frame_id
            floor = load_map(file, context.max_cells, confined=context.confine_images)
            return self._costmap(floor, frame_id)
        if context.static_map is None and not p.map_topic:
            raise ValueError(
                f"static layer {context.name!r} needs map_file or map_topic, or a map handed over by the program"
            )
        return context.static_map

    def _costmap(self, floor: OccupancyMap, frame_id: str) -> Costmap:
        p = self.parameters
        return floor.to_costmap(
            frame_id,
            self._context.track_unknown_space,
            self._context.max_cells,
            lethal_threshold=p.lethal_cost_threshold,
            trinary=p.trinary_costmap,
        )

    @property
    def map_topic(self) -> str:
        """Topic of the map."""
        topic: str = self.parameters.map_topic
        return topic

    def take_floor(self, floor: FloorMap | FloorWindow) -> None:
        """Keep a map, or the last one with its change; one that says nothing new is ignored.

        Raises ValueError where it has more than ``max_cells``, or is a change of one that has not come, or was refused.
        """
        if isinstance(floor, FloorWindow):
            if self._floor is None:
                raise ValueError(f"the update comes before its map on {self.map_topic}")
            floor = self._floor.with_window(floor)
        last, self._floor = self._floor, None  # changes of a map that is refused are none of the last one
        height, width = floor.occupancy.shape
        if height * width > self._context.max_cells:
            raise ValueError(f"{width} x {height} cells are more than the limit of {self._context.max_cells}")
        axis_aligned_shape(floor.occupancy.shape, floor.yaw, self._context.max_cells)
        self._floor = floor
        if last is None or not floor.equals(last):
            self._waiting.append(floor)

    def place_floor(self) -> bool:
        """Make the map that has come the floor plan."""
        if not self._waiting:
            return False
        floor = self._waiting.popleft()
        frame_id = floor.frame_id or self._context.frame_id
        pose = (floor.origin_x, floor.origin_y, floor.yaw)
        self._map = self._costmap(OccupancyMap(floor.occupancy, floor.resolution, pose), frame_id)
        if frame_id != self._placement.frame_id:
            self._placement = Placement(frame_id, self._context)
            self._placement.refresh()
        return True

    @property
    def permanent(self) -> bool:
        """Whether its map is in the costmap's frame, and no topic replaces it."""
        return self._placement.in_costmap_frame and not self.map_topic

    @property
    def floor_plan(self) -> Costmap | None:
        """The map as it came; None before the first one of a topic."""
        return self._map

    def configuration_warning(self) -> str:
        """Warn that nearly all of the map is occupied."""
        if self._map is None:
            return ""
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
        """Grid of the map, unless it is in another frame or has not come."""
        return self._map.geometry if self._map is not None and self._placement.in_costmap_frame else None

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
        if self._map is not None and self._placement.known:
            self.cells[box.slices] = sample_costmap(
                self._map, self.geometry, box, self.default_value, self._placement.T_data_costmap
            )

    def missing_floor(self) -> str:
        """Why the map of the topic is not there: none has come, or its frame has never been known."""
        placement = self._placement
        if self._map is None:
            return f"no map has come on {self.map_topic} yet"
        if not self.map_topic or placement.known:
            return ""
        return f"the map of {self.map_topic} cannot be placed: {placement.problem}"

    def stale_reason(self, now: float) -> str:
        """Why there is no map, or it cannot be placed because its frame is unknown."""
        return self.missing_floor() or self._placement.problem

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
        """Write the map; unknown cells of it leave what is below. Before the map comes all is unknown."""
        if self._map is None:
            cells[box.slices] = UNKNOWN
        method = CombinationMethod.MAXIMUM if self.parameters.use_maximum else CombinationMethod.OVERWRITE
        combine(cells, self.cells, box, method)
