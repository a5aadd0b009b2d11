"""Upright boxes and cylinders as geometry: distances, penetration depths and ray distances.

The kinematic world is made of these where Bullet would have bodies; each can be moved at any time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from terrain.physics.contact_depth import depth_in_circle, depth_in_polygon, gap_to_polygon, placed
from terrain.worlds.surface import Surface, box, cylinder

TINY = 1e-12  # stands for a direction of exactly zero, which would divide nothing by nothing


@dataclass
class UprightSolid:
    """One box or cylinder.

    Attributes
    ----------
    pose : Pose
        Of its middle; only the heading of the rotation counts.
    size : (2,) or (3,) float
        Radius and height of a cylinder, or length, width and height of a box [m].
    moving : bool
        Whether it will be moved, so that it is no part of the static world.
    """

    pose: Pose
    size: Sequence[float]
    moving: bool = False

    def distance(self, x: float, y: float) -> float:
        """Horizontal distance [m] from (x, y) to its outline, 0 inside."""
        ahead, left = self._in_own_frame(x - self.pose.x, y - self.pose.y)
        if len(self.size) == 2:
            return max(0.0, math.hypot(ahead, left) - self.size[0])
        return math.hypot(max(0.0, abs(ahead) - 0.5 * self.size[0]), max(0.0, abs(left) - 0.5 * self.size[1]))

    def depth(self, corners: FloatArray) -> float:
        """Penetration depth [m] of a convex outline (n, 2), counter-clockwise; below 0 where they are apart."""
        if len(self.size) == 2:
            return depth_in_circle(corners, self.pose.x, self.pose.y, self.size[0])
        return depth_in_polygon(corners, self._corners())

    def gap(self, corners: FloatArray) -> float:
        """Distance [m] between its outline and a convex one (n, 2), counter-clockwise; 0 where they overlap."""
        if len(self.size) == 2:
            return max(0.0, -self.depth(corners))
        return gap_to_polygon(corners, self._corners())

    def ray_distances(self, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """Distance [m] along each ray (n, 3) to its surface, inf for rays that miss it or start inside."""
        o = np.column_stack([*self._in_own_frame(*(origins[:, :2] - (self.pose.x, self.pose.y)).T), origins[:, 2]])
        d = np.column_stack([*self._in_own_frame(*directions[:, :2].T), directions[:, 2]])
        o[:, 2] -= self.pose.z
        d = np.where(d == 0.0, TINY, d)
        if len(self.size) == 2:
            spans = [_circle_span(o, d, self.size[0]), _slab_span(o[:, 2], d[:, 2], self.size[1])]
        else:
            spans = [_slab_span(o[:, axis], d[:, axis], self.size[axis]) for axis in range(3)]
        enters = np.max([span[0] for span in spans], axis=0)
        leaves = np.min([span[1] for span in spans], axis=0)
        return np.where((enters <= leaves) & (enters > 0.0), enters, np.inf)

    def surface(self) -> Surface:
        """Its surface in the map."""
        own = cylinder(self.size[0], self.size[1]) if len(self.size) == 2 else box(self.size)
        return own.at(self.pose)

    def _corners(self) -> FloatArray:
        """Corners (4, 2) [m] of a box in the map, counter-clockwise."""
        half_length, half_width = 0.5 * self.size[0], 0.5 * self.size[1]
        box = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * (half_length, half_width)
        return placed(box, self.pose.x, self.pose.y, self.pose.yaw)

    def _in_own_frame(self, dx: NDArray[np.float64] | float, dy: NDArray[np.float64] | float) -> tuple[float, float]:
        """Turn horizontal differences into ahead and left of the solid's heading."""
        cosine, sine = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        return cosine * dx + sine * dy, cosine * dy - sine * dx  # type: ignore[return-value]


def _slab_span(o: FloatArray, d: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """From where to where each ray is between two planes ``width`` apart."""
    one, other = (-0.5 * width - o) / d, (0.5 * width - o) / d
    return np.minimum(one, other), np.maximum(one, other)


def _circle_span(o: FloatArray, d: FloatArray, radius: float) -> tuple[FloatArray, FloatArray]:
    """From where to where each ray is inside an endless cylinder; an empty span where it never is."""
    a = d[:, 0] ** 2 + d[:, 1] ** 2
    b = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1]
    discriminant = b**2 - a * (o[:, 0] ** 2 + o[:, 1] ** 2 - radius**2)
    half = np.sqrt(np.maximum(discriminant, 0.0))
    return np.where(discriminant < 0.0, np.inf, (-b - half) / a), np.where(discriminant < 0.0, -np.inf, (half - b) / a)


class SolidRays:
    """Rays at the moving ones of a list of solids; see ``terrain.sensors.rays.RayCaster``."""

    def __init__(self, solids: Sequence[UprightSolid]) -> None:
        self._solids = solids

    def distances(self, origins: FloatArray, directions: FloatArray, max_range: float) -> FloatArray:
        """Distance (n,) [m] to the first hit of each ray, inf where there is none within ``max_range``."""
        nearest = np.full(len(origins), np.inf)
        for solid in self._solids:
            if solid.moving:
                nearest = np.minimum(nearest, solid.ray_distances(origins, directions))
        return np.where(nearest <= max_range, nearest, np.inf)
