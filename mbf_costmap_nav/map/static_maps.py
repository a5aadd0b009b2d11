"""What floor plans explain of the points that a sensor sees, whatever costmap they belong to.

A local costmap has no floor plan as a rule, so the costmaps of a server share those of their static layers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.transform_buffer import TransformBuffer
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap

FloatArray = NDArray[np.float64]


class StaticMaps:
    """Floor plans, each in its own frame.

    Parameters
    ----------
    transforms : TransformBuffer, optional
        Where the frames of floor plans are looked up; without it all must be in the frame of the points.
    """

    def __init__(self, transforms: TransformBuffer | None = None) -> None:
        self._transforms = transforms
        self._clearances: dict[Callable[[], Costmap | None], tuple[Costmap, NDArray[np.float32]] | None] = {}

    def add(self, floor_plan: Callable[[], Costmap | None]) -> None:
        """Take what returns a floor plan, which may be another one each time."""
        self._clearances[floor_plan] = None

    def explain(self, points: FloatArray, frame_id: str, distance: float) -> NDArray[np.bool_]:
        """Mask (n,) of the points (n, 3) [m] whose cell is within ``distance`` [m] of a wall of a floor plan.

        Raises
        ------
        TransformError
            The frame of a floor plan is not known.
        """
        explained = np.zeros(len(points), dtype=np.bool_)
        for floor_plan, clearance in self._present():
            there = points
            if floor_plan.frame_id != frame_id and self._transforms is not None:
                there = self._transforms.lookup(floor_plan.frame_id, frame_id).apply(points)
            ix = np.floor((there[:, 0] - floor_plan.origin_x) / floor_plan.resolution).astype(np.int64)
            iy = np.floor((there[:, 1] - floor_plan.origin_y) / floor_plan.resolution).astype(np.int64)
            inside = (ix >= 0) & (ix < floor_plan.width) & (iy >= 0) & (iy < floor_plan.height)
            explained[inside] |= clearance[iy[inside], ix[inside]] <= distance
        return explained

    def _present(self) -> Iterator[tuple[Costmap, NDArray[np.float32]]]:
        """Floor plans of now and the clearances on them, which are computed once for each."""
        for source, known in list(self._clearances.items()):
            floor_plan = source()
            if floor_plan is None:
                continue
            if known is None or known[0] is not floor_plan:
                self._clearances[source] = known = floor_plan, _clearance(floor_plan)
            yield known


def _clearance(floor_plan: Costmap) -> NDArray[np.float32]:
    """Distances (height, width) [m] of cells from the nearest wall, between their middles."""
    lethal = floor_plan.cells == LETHAL
    if not lethal.any():
        return np.full(lethal.shape, np.inf, dtype=np.float32)
    from scipy import ndimage  # takes 0.13 s to import, and a plan on a bare map does without it

    return np.asarray(ndimage.distance_transform_edt(~lethal) * floor_plan.resolution, dtype=np.float32)
