"""A recorded grid map: costs in steps of a hundredth, one byte each.

Made from ``GridView``, the server's own picture of its map; coarse enough that a replanning run of some minutes keeps
its maps in a few hundred kilobytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.maps.view import GridView

FORBIDDEN = 100
UNKNOWN = 255


@dataclass(frozen=True, eq=False)
class RecordedGrid:
    """The costs of a grid map at one time.

    Attributes
    ----------
    time : float
        [s] of the run.
    cells : (height, width) uint8
        0 free to 100 forbidden, 255 unknown; row 0 at the smallest y.
    extent : (x_min, x_max, y_min, y_max)
        [m]
    """

    time: float
    cells: NDArray[np.uint8]
    extent: tuple[float, float, float, float]

    @classmethod
    def of(cls, time: float, view: GridView) -> RecordedGrid:
        """Keep what a server shows of its map."""
        levels = np.round(FORBIDDEN * np.clip(view.costs, 0.0, 1.0))
        return cls(time, np.where(np.isnan(levels), UNKNOWN, levels).astype(np.uint8), view.extent)

    @property
    def costs(self) -> NDArray[np.float32]:
        """(height, width) 0 free to 1 forbidden, nan unknown."""
        levels = self.cells.astype(np.float32) / np.float32(FORBIDDEN)
        return np.where(self.cells == UNKNOWN, np.float32(np.nan), levels)


def grid_arrays(grids: list[RecordedGrid]) -> dict[str, Any]:
    """All grids as four arrays for a file: flat cells, shapes (n, 2), extents (n, 4), times (n,)."""
    return {
        "grid_cells": np.concatenate([np.zeros(0, np.uint8), *(grid.cells.ravel() for grid in grids)]),
        "grid_shapes": np.array([grid.cells.shape for grid in grids], np.int64).reshape(-1, 2),
        "grid_extents": np.array([grid.extent for grid in grids], np.float64).reshape(-1, 4),
        "grid_times": np.array([grid.time for grid in grids], np.float64),
    }


def grids_from(arrays: dict[str, Any]) -> list[RecordedGrid]:
    """Read what ``grid_arrays`` made; older recordings may have none."""
    if "grid_cells" not in arrays:
        return []
    shapes, ends = arrays["grid_shapes"], np.cumsum(arrays["grid_shapes"].prod(axis=1))
    parts = np.split(arrays["grid_cells"], ends[:-1]) if len(ends) else []
    facts = zip(arrays["grid_times"].tolist(), parts, shapes, arrays["grid_extents"].tolist(), strict=True)
    return [RecordedGrid(time, part.reshape(shape), tuple(extent)) for time, part, shape, extent in facts]
