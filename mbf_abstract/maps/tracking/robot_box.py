"""The outline of a robot for contacts with objects: a box, or a disc.

When to use: gaps to many objects at many poses at once. When not: cells and faces below the exact outline, which the
checks of the maps know.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mbf_abstract.geometry import FloatArray

CORNERS = 16
"""Of the outline of a round robot."""


class RobotBox(NamedTuple):
    """The robot's outline for contacts: a box in its own frame [m], grown by a radius [m] to all sides.

    A round robot is a box without extent and its radius.
    """

    back: float
    front: float
    right: float
    left: float
    radius: float

    @classmethod
    def disc(cls, radius: float) -> RobotBox:
        """Box of a round robot of a radius [m]."""
        return cls(0.0, 0.0, 0.0, 0.0, radius)

    @classmethod
    def around(cls, corners: ArrayLike) -> RobotBox:
        """Box around an outline with ``corners`` (n, 2) [m], x forward and y left."""
        outline = np.asarray(corners, dtype=np.float64)
        (back, right), (front, left) = outline.min(axis=0).tolist(), outline.max(axis=0).tolist()
        return cls(back, front, right, left, 0.0)

    def outline(self) -> FloatArray:
        """Corners (n, 2) [m], counter-clockwise; of a polygon around a round robot."""
        if self.radius > 0.0:
            angles = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
            return self.radius * np.array([(math.cos(angle), math.sin(angle)) for angle in angles.tolist()])
        corners = (self.back, self.right), (self.front, self.right), (self.front, self.left), (self.back, self.left)
        return np.array(corners, dtype=np.float64)

    def gaps(self, poses: FloatArray, places: FloatArray, radii: FloatArray) -> FloatArray:
        """Gaps (n, m) [m] of the robot at ``poses`` (n, 3) to discs at ``places`` (n, m, 2)."""
        dx, dy = places[:, :, 0] - poses[:, None, 0], places[:, :, 1] - poses[:, None, 1]
        c, s = np.cos(poses[:, None, 2]), np.sin(poses[:, None, 2])
        ahead, aside = c * dx + s * dy, c * dy - s * dx
        beyond_x = np.maximum(np.maximum(self.back - ahead, ahead - self.front), 0.0)
        beyond_y = np.maximum(np.maximum(self.right - aside, aside - self.left), 0.0)
        return np.asarray(np.hypot(beyond_x, beyond_y) - self.radius - radii)
