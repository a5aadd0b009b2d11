"""The rays of a scan in which a tracker sees points: beside a cluster they show what hides a part of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray


class Rays(NamedTuple):
    """All rays of one scan, and which of them hit the points that may be objects.

    Attributes
    ----------
    ends : (m, 3) float64
        Where each ray ends [m]: at what it hit, or at its maximal range.
    of_points : (n,) int64
        Which ray hit each point.
    """

    ends: FloatArray
    of_points: NDArray[np.int64]

    def thinned(self, stride: int) -> Rays:
        """The rays of every ``stride``-th point, and all that hit none of the points."""
        if stride == 1:
            return self
        kept = np.ones(len(self.ends), dtype=np.bool_)
        kept[self.of_points] = False
        kept[self.of_points[::stride]] = True
        return Rays(self.ends[kept], (np.cumsum(kept) - 1)[self.of_points[::stride]])
