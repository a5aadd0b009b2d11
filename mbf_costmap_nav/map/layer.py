"""The interface of a costmap layer, and a base for layers that keep cells of their own.

One update of a ``LayeredCostmap`` runs in two passes over its layers, in the configured order:

1. ``update_bounds``: a layer takes in new data and grows the box of cells that may change, of the layers before it.
2. ``update_costs``: the box is reset and every layer writes its part into the shared cells.

All hooks run while the costmap's lock is held: they must not call back into the costmap, and must not wait.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_abstract.maps.layers.layer import LayerParameters as LayerParameters
from mbf_abstract.maps.layers.layer import MapLayer
from mbf_abstract.maps.view import FloorMap, FloorWindow
from mbf_costmap_nav.grid.costmap import FREE, MAX_CELLS, UNKNOWN, CellArray, CellBox, Costmap, GridGeometry
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.map.static_maps import StaticMaps

CellType = TypeVar("CellType", bound=np.generic)


class CombinationMethod(str, Enum):
    """How a layer's cells enter the costmap."""

    OVERWRITE = "overwrite"
    MAXIMUM = "maximum"
    MAXIMUM_WITHOUT_UNKNOWN_OVERWRITE = "maximum_without_unknown_overwrite"


@dataclass(frozen=True)
class LayerContext:
    """What every layer is constructed with.

    Attributes
    ----------
    name : str
        Name of the layer in the configuration.
    parameters : LayerParameters
        Validated instance of the layer class's ``Parameters``.
    frame_id : str
        Frame of the costmap.
    rolling_window : bool
        Whether the grid moves with the robot.
    track_unknown_space : bool
        Whether unknown is a value of its own; otherwise unknown cells count as free.
    base_folder : Path
        Relative file names of the configuration start here.
    confine_images : bool
        Whether the image of a map or mask must lie in the folder of its YAML file.
    max_cells : int
        Larger maps and masks are refused before memory is taken.
    static_map : Costmap, optional
        A map handed over by the program instead of a file.
    transforms : TransformBuffer, optional
        Where the frames of the layer's data are looked up; without it everything must be in the costmap's frame.
    static_maps : StaticMaps
        Floor plans that explain what sensors see of walls, also those of the server's other costmap.
    """

    name: str
    parameters: LayerParameters
    frame_id: str = "map"
    rolling_window: bool = False
    track_unknown_space: bool = False
    base_folder: Path = field(default_factory=Path)
    confine_images: bool = False
    static_map: Costmap | None = None
    transforms: TransformBuffer | None = None
    max_cells: int = MAX_CELLS
    static_maps: StaticMaps = field(default_factory=StaticMaps)


class CostmapLayer(MapLayer):
    """One source of costs. ``geometry`` is the costmap's grid, set before the first update."""

    contract_check: ClassVar[str] = "mbf_costmap_nav.testing:check_layer"
    clearable: ClassVar[bool] = True
    """Whether clearing names it, and takes an area out of it, if no layers are named; not a floor plan."""
    draws_areas: ClassVar[bool] = False
    """Whether nothing stands where it forbids: somebody has drawn it."""
    geometry: GridGeometry

    def __init__(self, context: LayerContext) -> None:
        super().__init__(context.name, context.parameters)
        self.track_unknown_space = context.track_unknown_space
        self.rolling_window = context.rolling_window

    def preferred_geometry(self) -> GridGeometry | None:
        """Grid the costmap should have because of this layer (a static map); None = any."""
        return None

    @property
    def floor_plan(self) -> Costmap | None:
        """Map of what stands for ever, in its own frame, if the layer has one."""
        return None

    @property
    def map_topic(self) -> str:
        """Topic on which the layer expects its floor plan; empty if it expects none."""
        return ""

    def take_floor(self, floor: FloorMap | FloorWindow) -> None:
        """Keep a floor that has come on ``map_topic``; raises ValueError where the layer has no use for it.

        Called on the thread of the topic, also while the map is being updated; must be quick.
        """
        raise ValueError(f"the layer {self.name!r} expects no floor")

    def place_floor(self) -> bool:
        """Begin an update: make the floor that has come the floor plan; if there is one, ``match_geometry`` follows."""
        return False

    def missing_floor(self) -> str:
        """Why the floor plan of ``map_topic`` is not there, so that nothing can be planned; empty if it is."""
        return ""

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Take over a new grid and forget all cells."""
        self.geometry = geometry

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Take over the grid of a rolling window that moved by (dx, dy) cells; keep the cells of the overlap."""
        self.geometry = geometry

    def set_footprint(self, footprint: Footprint, unpadded: Footprint) -> None:
        """Take over the outline of the robot, padded and not."""

    def parameters_changed(self) -> None:
        """Take over ``parameters``, just replaced, where something was derived from them; the next update computes all.

        May raise ValueError: the old ones are then put back.
        """

    def update_bounds(self, robot_pose: Pose | None, now: float, box: CellBox) -> CellBox:
        """Take in new data; return ``box`` grown by the cells that may change (it may reach beyond the grid)."""
        return box

    @abstractmethod
    def update_costs(self, cells: CellArray, box: CellBox) -> None:
        """Write this layer's costs into ``cells[box.slices]`` (height, width) uint8; ``box`` lies on the grid."""

    @property
    def forgets(self) -> bool:
        """Whether ``reset`` is its own."""
        return type(self).reset is not CostmapLayer.reset

    def reset(self) -> None:
        """Forget everything the layer has gathered; a static layer returns to its map."""

    def clear_area(self, box: CellBox, inside: bool) -> None:
        """Forget the cells in ``box``, or all cells out of it (``inside`` false)."""

    @property
    def permanent(self) -> bool:
        """Whether neither a sensor nor a transform changes its cells: what it forbids stays forbidden."""
        return False

    def lethal_reason(self, x: float, y: float) -> str:
        """Why the cell at (x, y) [m] is lethal, for a user: what is drawn there; empty if the layer's name says all."""
        return ""

    @property
    def only_raises(self) -> bool:
        """Whether it never lowers the costs of the layers before it."""
        return getattr(self.parameters, "combination_method", None) not in (None, CombinationMethod.OVERWRITE)

    def speed_limit(self, x: float, y: float, full_speed: float) -> float:
        """Allowed speed [m/s] at the point (x, y) [m], at most ``full_speed``."""
        return full_speed

    def speed_limit_at(self, pose: Pose, full_speed: float) -> float:
        """The limit [m/s] at the pose's place."""
        return self.speed_limit(pose.x, pose.y, full_speed)


class GridLayer(CostmapLayer):
    """A layer that keeps its own cells and combines them into the costmap."""

    cells: CellArray

    @property
    def default_value(self) -> int:
        """What a cell without information holds."""
        return UNKNOWN if self.track_unknown_space else FREE

    def match_geometry(self, geometry: GridGeometry) -> None:
        """Allocate cells of the default value."""
        super().match_geometry(geometry)
        self.cells = np.full((geometry.height, geometry.width), self.default_value, dtype=np.uint8)

    def shift(self, geometry: GridGeometry, dx: int, dy: int) -> None:
        """Move the kept cells; new ones get the default value."""
        super().shift(geometry, dx, dy)
        self.cells = shifted(self.cells, dx, dy, self.default_value)

    def reset(self) -> None:
        """Set all cells to the default value."""
        self.cells.fill(self.default_value)

    def clear_area(self, box: CellBox, inside: bool) -> None:
        """Set the cells inside or outside of ``box`` to the default value."""
        clear_cells(self.cells, box.clipped(self.geometry.box), inside, self.default_value)


def shifted(cells: NDArray[CellType], dx: int, dy: int, fill: float) -> NDArray[CellType]:
    """Return the cells seen by a window that moved by (dx, dy) cells; what was outside becomes ``fill``."""
    height, width = cells.shape
    moved = np.full_like(cells, fill)
    if abs(dx) < width and abs(dy) < height:
        source = cells[max(dy, 0) : height + min(dy, 0), max(dx, 0) : width + min(dx, 0)]
        moved[max(-dy, 0) : height + min(-dy, 0), max(-dx, 0) : width + min(-dx, 0)] = source
    return moved


def clear_cells(cells: NDArray[CellType], box: CellBox, inside: bool, value: float) -> None:
    """Set the cells (height, width) inside ``box`` to ``value``, or all others (``inside`` false)."""
    if inside:
        if not box.empty:
            cells[box.slices] = value
        return
    kept = None if box.empty else cells[box.slices].copy()
    cells.fill(value)
    if kept is not None:
        cells[box.slices] = kept


def combine(cells: CellArray, layer_cells: CellArray, box: CellBox, method: CombinationMethod) -> None:
    """Write a layer's cells (height, width) of ``box`` into the costmap's; unknown ones never change a maximum."""
    old, new = cells[box.slices], layer_cells[box.slices]
    if method is CombinationMethod.OVERWRITE:
        np.copyto(old, new, where=new != UNKNOWN)
    elif method is CombinationMethod.MAXIMUM:
        # Unknown is the largest byte, but it gives way to anything known: one up, it wraps around to the smallest.
        old += 1
        np.maximum(old, new + 1, out=old)
        old -= 1
    else:
        np.copyto(old, new, where=(new != UNKNOWN) & (old != UNKNOWN) & (old < new))
