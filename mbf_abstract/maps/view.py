"""Views of a map for pictures and viewers: an image of costs, a mesh with costs, directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

OCCUPIED, UNKNOWN_OCCUPANCY = 100, 255
"""Occupancies of cells: occupied from the first value on, unknown at the second."""


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
    """Content of a map file of a floor.

    Attributes
    ----------
    occupancy : (height, width) uint8
        0 free to 100 and above occupied, 255 unknown; row 0 at the smallest y.
    resolution : float
        Side of a cell [m].
    origin_x, origin_y : float
        Lower left corner of cell (0, 0) [m].
    """

    occupancy: NDArray[np.uint8]
    resolution: float
    origin_x: float
    origin_y: float


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
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    costs: NDArray[np.float32]


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
