"""What a range sensor saw, in a form that every server's map can take."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.transform_buffer import ExtrapolationError, TransformBuffer

TRANSFORM_TOLERANCE = 0.3
"""How much newer [s] than the newest transform a scan may be; costmap_2d's and Nav2's default."""

MAX_STAMP_LEAD = 0.2
"""How far [s] a stamp may lie in the future: what clocks of two computers differ by, not what a broken one does."""


@dataclass(frozen=True, eq=False)
class RangeScan:
    """One scan of a lidar or depth camera.

    Attributes
    ----------
    source : str
        Name of the sensor, as layers of the configuration call it.
    frame_id : str
        Frame of ``origin`` and ``ends``.
    origin : (3,) float64
        Where the rays start [m].
    ends : (n, 3) float64
        Where each ray ends [m]: at what it hit, or at its maximal range.
    hits : (n,) bool
        Whether the ray hit something.
    stamp : float
        Time of the measurement [s].
    """

    source: str
    frame_id: str
    origin: FloatArray
    ends: FloatArray
    hits: NDArray[np.bool_]
    stamp: float

    def in_frame(self, frame_id: str, transforms: TransformBuffer, tolerance: float = TRANSFORM_TOLERANCE) -> RangeScan:
        """Express the scan in another frame, by the transform of the moment it was measured.

        A scan newer than the newest transform by at most ``tolerance`` [s] is placed by that one.

        Raises
        ------
        TransformError
            There is no transform at the scan's stamp.
        """
        if frame_id == self.frame_id:
            return self
        try:
            transform = transforms.lookup(frame_id, self.frame_id, self.stamp)
        except ExtrapolationError:
            transform = transforms.lookup(frame_id, self.frame_id)
            if not 0.0 <= self.stamp - transform.stamp <= tolerance:
                raise
        origin = transform.apply(np.atleast_2d(self.origin))[0]
        return replace(self, frame_id=frame_id, origin=origin, ends=transform.apply(self.ends))

    @property
    def points(self) -> FloatArray:
        """(k, 3) float64, the points that were hit [m]."""
        return np.asarray(self.ends[self.hits], dtype=np.float64)
