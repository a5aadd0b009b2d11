"""Where on its path a robot is: a projection that only moves forward, so storeys and loops are never mixed up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.arithmetic import norm, scalar_products
from mbf_abstract.geometry import Path

_SAME_DISTANCE = 0.05  # [m] a first projection prefers the earliest point that is about as near as the nearest


@dataclass(frozen=True)
class PathProjection:
    """The point of the path a robot has got to.

    Attributes
    ----------
    position : (3,) float64
        The projected point [m].
    travelled, remaining : float
        Length of the path before and behind it [m].
    deviation : float
        Distance of the robot from it [m].
    """

    position: NDArray[np.float64]
    travelled: float
    remaining: float
    deviation: float


class PathProgress:
    """Follows a robot along one path.

    Parameters
    ----------
    path : Path
        At least one pose.
    window : float
        How far ahead of the last projection the next one is searched [m].
    """

    def __init__(self, path: Path, window: float) -> None:
        self.positions = path.positions
        self.window = window
        steps = norm(np.diff(self.positions, axis=0))
        self.arc_lengths = np.concatenate([[0.0], np.cumsum(steps)])
        self._travelled: float | None = None

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(self.arc_lengths[-1])

    def update(self, position: NDArray[np.float64]) -> PathProjection:
        """Project ``position`` (3,) onto the path, at or ahead of the last projection."""
        if self._travelled is None:
            offsets = norm(self.positions - position)
            nearest = int(np.argmax(offsets <= offsets.min() + _SAME_DISTANCE))
            self._travelled = float(self.arc_lengths[max(nearest - 1, 0)])
        start = self._travelled
        first = max(int(np.searchsorted(self.arc_lengths, start, side="right")) - 1, 0)
        last = int(np.searchsorted(self.arc_lengths, start + self.window, side="left")) + 1
        points = self.positions[first : last + 1]
        if len(points) < 2:
            projected, travelled = self.positions[-1], self.length
        else:
            projected, along = _nearest_on_polyline(points, position)
            travelled = max(start, float(self.arc_lengths[first]) + along)
        self._travelled = travelled
        deviation = float(norm(projected - position))
        return PathProjection(projected, travelled, self.length - travelled, deviation)

    def point_at(self, travelled: float) -> NDArray[np.float64]:
        """Point (3,) of the path at an arc length [m]; its ends beyond them."""
        return np.asarray(self.points_at(np.array([travelled]))[0])

    def points_at(self, travelled: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) of the path at arc lengths (n,) [m]."""
        columns = [np.interp(travelled, self.arc_lengths, self.positions[:, axis]) for axis in range(3)]
        return np.stack(columns, axis=-1)


def _nearest_on_polyline(
    points: NDArray[np.float64], position: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Nearest point of the segments through ``points`` (n >= 2, 3), and its arc length [m] from the first."""
    steps = np.diff(points, axis=0)
    lengths = norm(steps)
    along = scalar_products(position - points[:-1], steps) / np.maximum(lengths**2, 1e-18)
    along = np.clip(along, 0.0, 1.0)
    candidates = points[:-1] + along[:, None] * steps
    best = int(np.argmin(norm(candidates - position)))
    return candidates[best], float(lengths[:best].sum() + along[best] * lengths[best])
