"""What a range sensor saw, in a form that every server's map can take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray


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

    @property
    def points(self) -> FloatArray:
        """(k, 3) float64, the points that were hit [m]."""
        return np.asarray(self.ends[self.hits], dtype=np.float64)
