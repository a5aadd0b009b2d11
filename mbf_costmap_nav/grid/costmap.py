"""A 2D costmap: one byte per cell, and the conversion between world coordinates and cells.

The values are those of costmap_2d: 0 free, 1..252 growing cost, 253 the robot's inscribed circle touches an obstacle,
254 obstacle, 255 unknown. Cells are indexed ``cells[iy, ix]``; row 0 is the bottom row (smallest y). The grid's axes
are parallel to the axes of its frame: a map file with a yaw is resampled when it is loaded (see ``map_io``).

Cell (ix, iy) is the half-open square [origin + i * resolution, origin + (i + 1) * resolution) on both axes. The
conversions repeat costmap_2d's rules, including the truncation toward zero of the unbounded one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_costmap_nav.kernels.costs import FREE as FREE
from mbf_costmap_nav.kernels.costs import INSCRIBED as INSCRIBED
from mbf_costmap_nav.kernels.costs import LETHAL as LETHAL
from mbf_costmap_nav.kernels.costs import UNKNOWN as UNKNOWN

CellArray = NDArray[np.uint8]

MAX_CELLS = 64_000_000
"""Default limit of a map's size, 8000 x 8000 cells; checked before memory is taken."""


class CellBox(NamedTuple):
    """A half-open rectangle of cells: x0 <= ix < x1, y0 <= iy < y1. It is empty where an end is not after a start."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def empty(self) -> bool:
        """Whether no cell lies inside."""
        return self.x1 <= self.x0 or self.y1 <= self.y0

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the box in an array of cells: ``cells[box.slices]``."""
        return slice(self.y0, self.y1), slice(self.x0, self.x1)

    def union(self, other: CellBox) -> CellBox:
        """Smallest box that holds both; an empty box adds nothing."""
        if self.empty:
            return other
        if other.empty:
            return self
        return CellBox(min(self.x0, other.x0), min(self.y0, other.y0), max(self.x1, other.x1), max(self.y1, other.y1))

    def grown(self, cells: int) -> CellBox:
        """Return the box with ``cells`` more on each side; an empty box stays empty."""
        return self if self.empty else CellBox(self.x0 - cells, self.y0 - cells, self.x1 + cells, self.y1 + cells)

    def clipped(self, other: CellBox) -> CellBox:
        """Return the part of the box that lies in ``other``."""
        return CellBox(max(self.x0, other.x0), max(self.y0, other.y0), min(self.x1, other.x1), min(self.y1, other.y1))


EMPTY_BOX = CellBox(0, 0, 0, 0)


@dataclass(frozen=True)
class GridGeometry:
    """Where a grid lies: ``width`` x ``height`` cells of ``resolution`` [m], lower-left corner at the origin [m]."""

    width: int
    height: int
    resolution: float
    origin_x: float = 0.0
    origin_y: float = 0.0

    @property
    def box(self) -> CellBox:
        """All cells of the grid."""
        return CellBox(0, 0, self.width, self.height)

    @property
    def upper_x(self) -> float:
        """X coordinate [m] of the right border."""
        return self.origin_x + self.width * self.resolution

    @property
    def upper_y(self) -> float:
        """Y coordinate [m] of the upper border."""
        return self.origin_y + self.height * self.resolution

    def world_to_cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Cell (ix, iy) that holds the point (x, y) [m], or None outside the grid."""
        if x < self.origin_x or y < self.origin_y:
            return None
        ix = int((x - self.origin_x) / self.resolution)
        iy = int((y - self.origin_y) / self.resolution)
        return (ix, iy) if ix < self.width and iy < self.height else None

    def world_to_cell_clamped(self, x: float, y: float) -> tuple[int, int]:
        """Cell that holds (x, y) [m], or the border cell next to it outside the grid."""
        ix, iy = self.world_to_cell_unbounded(max(x, self.origin_x), max(y, self.origin_y))
        return min(ix, self.width - 1), min(iy, self.height - 1)

    def world_to_cell_unbounded(self, x: float, y: float) -> tuple[int, int]:
        """Cell index of (x, y) [m] on an endless grid, truncated toward zero as costmap_2d does."""
        return int((x - self.origin_x) / self.resolution), int((y - self.origin_y) / self.resolution)

    def world_to_cells(self, points: ArrayLike) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Cells of many points at once.

        Parameters
        ----------
        points : (n, 2) or (n, 3) float
            World coordinates [m]; a third column is ignored. Must be finite.

        Returns
        -------
        cells : (n, 2) int32
            (ix, iy), rounded down; rows outside the grid hold an index outside it.
        inside : (n,) bool
        """
        xy = np.asarray(points, dtype=np.float64)[:, :2]
        scaled = np.floor((xy - (self.origin_x, self.origin_y)) / self.resolution)
        cells = np.clip(scaled, -1, (self.width, self.height)).astype(np.int32)
        inside = np.all((cells >= 0) & (cells < (self.width, self.height)), axis=1)
        return cells, inside

    def cell_to_world(self, ix: int, iy: int) -> tuple[float, float]:
        """Centre (x, y) [m] of a cell."""
        return (self.origin_x + (ix + 0.5) * self.resolution, self.origin_y + (iy + 0.5) * self.resolution)

    def cells_to_world(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Centres (n, 2) [m] of many cells (n, 2)."""
        centres = (np.asarray(cells, dtype=np.float64) + 0.5) * self.resolution
        return np.asarray(np.add(centres, (self.origin_x, self.origin_y)))

    def contains(self, x: float, y: float) -> bool:
        """Whether the point (x, y) [m] lies on the grid."""
        return self.world_to_cell(x, y) is not None


class Costmap(GridGeometry):
    """The cells of a grid with the frame they are expressed in; as a snapshot its cells are read-only.

    Parameters
    ----------
    cells : (height, width) uint8
        Costs; not copied. C-contiguous, so that kernels take it without a copy.
    resolution : float
        Side of a cell [m].
    origin_x, origin_y : float
        Lower-left corner of cell (0, 0) [m] in ``frame_id``.
    stamp : float
        Time of the last update [s].
    version : int
        Grows with every change of the cells; two snapshots of one map with equal versions are equal.

    Raises
    ------
    ValueError
        ``cells`` is not a two-dimensional uint8 array with at least one cell, or the resolution is not positive.
    """

    cells: CellArray
    frame_id: str
    stamp: float
    version: int

    def __init__(
        self,
        cells: CellArray,
        resolution: float,
        origin_x: float = 0.0,
        origin_y: float = 0.0,
        frame_id: str = "map",
        stamp: float = 0.0,
        version: int = 0,
    ) -> None:
        if cells.ndim != 2 or cells.dtype != np.uint8 or cells.size == 0:
            raise ValueError(f"cells must be a (height, width) uint8 array, got {cells.dtype} {cells.shape}")
        if not (np.isfinite(resolution) and resolution > 0.0):
            raise ValueError(f"resolution must be positive, got {resolution}")
        super().__init__(cells.shape[1], cells.shape[0], float(resolution), float(origin_x), float(origin_y))
        for name, value in (
            ("cells", np.ascontiguousarray(cells)),
            ("frame_id", frame_id),
            ("stamp", stamp),
            ("version", version),
        ):
            object.__setattr__(self, name, value)

    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        return self is other

    @property
    def geometry(self) -> GridGeometry:
        """The grid without its cells."""
        return GridGeometry(self.width, self.height, self.resolution, self.origin_x, self.origin_y)

    def cost(self, ix: int, iy: int) -> int:
        """Value of one cell, which must lie on the grid."""
        return int(self.cells[iy, ix])

    def cost_at(self, x: float, y: float) -> int | None:
        """Value of the cell at the point (x, y) [m], or None outside the grid."""
        cell = self.world_to_cell(x, y)
        return None if cell is None else self.cost(*cell)

    def part(self, box: CellBox) -> Costmap:
        """Return the cells of a box, which must lie on the grid, as a costmap of its own."""
        x, y = self.origin_x + box.x0 * self.resolution, self.origin_y + box.y0 * self.resolution
        cells = self.cells[box.y0 : box.y1, box.x0 : box.x1]
        return Costmap(cells, self.resolution, x, y, self.frame_id, self.stamp, self.version)

    def __repr__(self) -> str:
        return (
            f"<Costmap {self.width} x {self.height} cells of {self.resolution:g} m at "
            f"({self.origin_x:g}, {self.origin_y:g}) in {self.frame_id!r}>"
        )
