"""Maps for pictures, viewers and messages: an image of costs, a floor of cells, a mesh with costs, directions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FARTHEST_COORDINATE

OCCUPIED, UNKNOWN_OCCUPANCY = 100, 255
"""Occupancies of cells: occupied from the first value on, unknown at the second."""
LEAST_RESOLUTION, GREATEST_RESOLUTION = 1e-4, 1e3
"""Sides of cells [m] that maps may have."""


@dataclass(frozen=True, eq=False)
class GridView:
    """A map of cells.

    Attributes
    ----------
    costs : (height, width) float32
        0 free to 1 and above forbidden, nan unknown; row 0 at the smallest y.
    extent : (x_min, x_max, y_min, y_max)
        [m]
    """

    costs: NDArray[np.float32]
    extent: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class FloorMap:
    """The map of a floor, of a file or a message.

    Attributes
    ----------
    occupancy : (height, width) uint8
        0 free to 100 and above occupied, 255 unknown; row 0 at the smallest y.
    resolution : float
        Side of a cell [m].
    origin_x, origin_y, yaw : float
        Pose [m, m, rad] of the lower left corner of cell (0, 0).
    frame_id : str
        Frame of that pose; empty = that of who asks.

    Raises
    ------
    TypeError
        The occupancy is no array of uint8.
    ValueError
        It has no cells, or the resolution or the pose means nothing.
    """

    occupancy: NDArray[np.uint8]
    resolution: float
    origin_x: float
    origin_y: float
    yaw: float = 0.0
    frame_id: str = ""

    def __post_init__(self) -> None:
        _require_cells("FloorMap", self.occupancy)
        if not LEAST_RESOLUTION <= self.resolution <= GREATEST_RESOLUTION:
            limits = f"{LEAST_RESOLUTION:g} to {GREATEST_RESOLUTION:g} m"
            raise ValueError(f"FloorMap.resolution: expected {limits}, got {self.resolution}")
        for name, value in (("origin_x", self.origin_x), ("origin_y", self.origin_y), ("yaw", self.yaw)):
            if not abs(value) <= FARTHEST_COORDINATE:  # or nan
                limits = f"a number within {FARTHEST_COORDINATE:g} of zero"
                raise ValueError(f"FloorMap.{name}: expected {limits}, got {value}")

    def equals(self, other: FloorMap) -> bool:
        """Whether the other map says the same of the same place."""
        here = (self.resolution, self.origin_x, self.origin_y, self.yaw, self.frame_id)
        there = (other.resolution, other.origin_x, other.origin_y, other.yaw, other.frame_id)
        return here == there and np.array_equal(self.occupancy, other.occupancy)

    def with_window(self, window: FloorWindow) -> FloorMap:
        """Return the map with other values in a window; raises ValueError where that is not on it."""
        height, width = window.occupancy.shape
        rows, columns = self.occupancy.shape
        if window.frame_id != self.frame_id:
            raise ValueError(f"the update is in the frame {window.frame_id!r}, its map in {self.frame_id!r}")
        if not (0 <= window.x <= columns - width and 0 <= window.y <= rows - height):
            raise ValueError(
                f"the update of {width} x {height} cells at ({window.x}, {window.y}) reaches beyond its map of "
                f"{columns} x {rows}"
            )
        occupancy = self.occupancy.copy()
        occupancy[window.y : window.y + height, window.x : window.x + width] = window.occupancy
        return replace(self, occupancy=occupancy)


@dataclass(frozen=True, eq=False)
class FloorWindow:
    """New values of a part of a floor's map.

    Attributes
    ----------
    occupancy : (height, width) uint8
        As in ``FloorMap``.
    x, y : int
        Column and row of its first cell on the map.
    frame_id : str
        That of the map.

    Raises
    ------
    TypeError, ValueError
        As a ``FloorMap``.
    """

    occupancy: NDArray[np.uint8]
    x: int
    y: int
    frame_id: str = ""

    def __post_init__(self) -> None:
        _require_cells("FloorWindow", self.occupancy)


def _require_cells(what: str, occupancy: Any) -> None:
    """Raise where an occupancy is no rectangle of cells."""
    expected = "(height, width) uint8: 0 free to 100 occupied, 255 unknown"
    if getattr(occupancy, "dtype", None) != np.uint8:
        got = f"an array of {occupancy.dtype}" if isinstance(occupancy, np.ndarray) else type(occupancy).__name__
        raise TypeError(f"{what}.occupancy: expected {expected}, got {got}")
    if occupancy.ndim != 2 or occupancy.size == 0:
        raise ValueError(f"{what}.occupancy: expected {expected}, got the shape {occupancy.shape}")


@dataclass(frozen=True, eq=False)
class MeshView:
    """A map of triangles.

    Attributes
    ----------
    vertices : (V, 3) float64
        [m]
    faces : (F, 3) int32
    costs : (V,) float32
        0 free to 1 and above forbidden; inf is forbidden.
    unit : str
        Of the costs, such as rad; empty = none.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    costs: NDArray[np.float32]
    unit: str = ""


@dataclass(frozen=True, eq=False)
class FieldView:
    """Directions in which a plan leads, also from places beside its path.

    Attributes
    ----------
    points : (n, 3) float64
        [m]
    directions : (n, 3) float32
        Unit vectors towards the goal.
    """

    points: NDArray[np.float64]
    directions: NDArray[np.float32]


MapView = GridView | MeshView
