"""Places layer data given in another frame than the costmap: a floor plan, zones, a mask.

When to use: in a layer whose data does not come from a sensor. When not: for observations, which the server brings into
the costmap's frame, because they are valid at their own time only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.transform import Transform, TransformError
from mbf_costmap_nav.map.layer import LayerContext


class Placement:
    """The newest transform between a costmap and the frame of some data.

    Attributes
    ----------
    frame_id : str
        Frame of the data.
    T_data_costmap : Transform or None
        None where both are in one frame, and while the transform is unknown.
    problem : str
        Why the data cannot be placed; empty while it is.
    """

    def __init__(self, frame_id: str, context: LayerContext) -> None:
        self.frame_id = frame_id or context.frame_id
        self._costmap_frame_id = context.frame_id
        self._transforms = context.transforms
        self.T_data_costmap: Transform | None = None
        self.problem = "" if self.in_costmap_frame else "its data has not been placed yet"

    @property
    def in_costmap_frame(self) -> bool:
        """Whether there is nothing to transform."""
        return self.frame_id == self._costmap_frame_id

    @property
    def known(self) -> bool:
        """Whether a transform is known, or was known before it got lost."""
        return self.in_costmap_frame or self.T_data_costmap is not None

    def refresh(self) -> bool:
        """Look the transform up; return whether it has changed."""
        if self.in_costmap_frame:
            return False
        try:
            if self._transforms is None:
                raise TransformError(f"no transforms to place data of the frame {self.frame_id!r}")
            found = self._transforms.lookup(self.frame_id, self._costmap_frame_id)
        except TransformError as error:
            self.problem = str(error)
            return False
        last, self.T_data_costmap, self.problem = self.T_data_costmap, found, ""
        return last is None or (last.translation, last.rotation) != (found.translation, found.rotation)

    def to_data(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 2) [m] of the costmap's frame in that of the data."""
        return points if self.T_data_costmap is None else mapped(self.T_data_costmap, points)

    def to_costmap(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 2) [m] of the data's frame in that of the costmap."""
        return points if self.T_data_costmap is None else mapped(self.T_data_costmap.inverse(), points)


def mapped(transform: Transform, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (n, 2) [m] of a flat world in the transform's parent frame."""
    return transform.apply(np.pad(points, ((0, 0), (0, 1))))[:, :2]
