"""Convex solids of collision shapes: box, cylinder, sphere, and the hull of a mesh.

``support`` is exact: the distance of the farthest point in a direction. ``points`` span a hull that holds the solid and
touches it along its own axes; elsewhere the hull of a round solid is at most 0.5 % of its radius larger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import norm, rotated, rotated_back, scalar_products

SIDES = 32  # of the polygon around a circle
RINGS = 8  # circles of latitude of a half sphere

CORNERS = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])


@dataclass(frozen=True)
class Box:
    """A box of ``size`` [m] about its origin."""

    size: tuple[float, float, float]

    def support(self, direction: FloatArray) -> float:
        """Distance [m] of the farthest point along the unit vector ``direction`` (3,)."""
        (x, y, z), (a, b, c) = direction.tolist(), self.size
        return float(0.5 * (a * abs(x) + b * abs(y) + c * abs(z)))

    def points(self) -> FloatArray:
        """Corners (8, 3) [m]."""
        return np.asarray(CORNERS * np.array(self.size))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z about its origin."""

    radius: float
    length: float

    def support(self, direction: FloatArray) -> float:
        """As of ``Box``."""
        x, y, z = direction.tolist()
        return float(self.radius * math.hypot(x, y) + 0.5 * self.length * abs(z))

    def points(self) -> FloatArray:
        """Corners (n, 3) [m] of the prism around it."""
        ring = _ring_around(self.radius)
        return np.concatenate([_at_height(ring, 0.5 * side * self.length) for side in (-1.0, 1.0)])


@dataclass(frozen=True)
class Sphere:
    """A sphere about its origin."""

    radius: float

    def support(self, direction: FloatArray) -> float:
        """As of ``Box``."""
        return self.radius

    def points(self) -> FloatArray:
        """Points (n, 3) [m] on circles of latitude, and the poles."""
        latitudes = [0.5 * math.pi * ring / RINGS for ring in range(-RINGS, RINGS + 1)]
        rings = [_at_height(_ring_around(self.radius * math.cos(a)), self.radius * math.sin(a)) for a in latitudes]
        return np.concatenate(rings)


@dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of a mesh.

    Attributes
    ----------
    file : Path
        Of the mesh.
    vertices : (n, 3) float64
        [m], the mesh's scale applied.
    faces : (m, 3) int32
    """

    file: Path
    vertices: FloatArray
    faces: NDArray[np.int32]

    def support(self, direction: FloatArray) -> float:
        """As of ``Box``."""
        return float(scalar_products(self.vertices, direction).max())

    def points(self) -> FloatArray:
        """Corners (n, 3) [m]."""
        return self.vertices

    def edges(self) -> NDArray[np.int32]:
        """Indices (k, 2) of the corners that each edge of a face joins."""
        edges = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        return np.unique(np.sort(edges, axis=1), axis=0)


Solid = Box | Cylinder | Sphere | Hull


@dataclass(frozen=True, eq=False)
class Placed:
    """A solid somewhere.

    Attributes
    ----------
    T_frame_solid : (4, 4) float64
        Where it is in some frame.
    """

    solid: Solid
    T_frame_solid: FloatArray

    def support(self, direction: FloatArray) -> float:
        """Largest coordinate [m] along the unit vector ``direction`` (3,) of the frame."""
        rotation, origin = self.T_frame_solid[:3, :3], self.T_frame_solid[:3, 3]
        return self.solid.support(rotated_back(rotation, direction)) + float(scalar_products(origin, direction))

    def extent(self, direction: FloatArray) -> float:
        """Its length [m] along ``direction``."""
        return self.support(direction) + self.support(-direction)

    def points(self) -> FloatArray:
        """Points (n, 3) [m] in the frame whose hull holds it."""
        return np.asarray(rotated(self.T_frame_solid[:3, :3], self.solid.points()) + self.T_frame_solid[:3, 3])

    def points_between(self, low: float, high: float) -> FloatArray:
        """Points (k, 3) that span the part of ``points`` between two heights [m]."""
        return points_between(self.points(), low, high, self.solid.edges() if isinstance(self.solid, Hull) else None)

    def within(self, T_outer_frame: FloatArray) -> Placed:
        """The solid in an outer frame."""
        return Placed(self.solid, T_outer_frame @ self.T_frame_solid)


def points_between(points: FloatArray, low: float, high: float, edges: NDArray[np.int32] | None = None) -> FloatArray:
    """Points (k, 3) that span the part of a convex body between two heights [m].

    Parameters
    ----------
    points : (n, 3) float
        Whose hull the body is.
    edges : (k, 2) int32, optional
        Indices of the points that the edges of the hull join. Without them all pairs of points are cut, whose number
        grows with the square of n.
    """
    kept = [points[(points[:, 2] >= low) & (points[:, 2] <= high)]]
    for height in (low, high):
        if math.isfinite(height):
            a, b = _ends_across(points, height, edges)
            share = (height - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
            kept.append(a + share * (b - a))
    return np.concatenate(kept)


def _ends_across(points: FloatArray, height: float, edges: NDArray[np.int32] | None) -> tuple[FloatArray, FloatArray]:
    """Ends (k, 3) below and above a height of the edges that cross it."""
    below, above = points[:, 2] < height, points[:, 2] > height
    if edges is None:
        low, high = (np.flatnonzero(side) for side in (below, above))
        return points[np.repeat(low, len(high))], points[np.tile(high, len(low))]
    both = np.concatenate([edges, edges[:, ::-1]])
    rising = both[below[both[:, 0]] & above[both[:, 1]]]
    return points[rising[:, 0]], points[rising[:, 1]]


def _ring_around(radius: float) -> FloatArray:
    """Polygon (n, 2) around a circle that touches it on the axes."""
    outer = radius / math.cos(math.pi / SIDES)
    angles = [2.0 * math.pi * (k + 0.5) / SIDES for k in range(SIDES)]
    return np.array([(outer * math.cos(angle), outer * math.sin(angle)) for angle in angles])


def _at_height(ring: FloatArray, z: float) -> FloatArray:
    return np.column_stack([ring, np.full(len(ring), z)])


def unit(vector: FloatArray) -> FloatArray:
    """The vector (3,) at length 1; a zero vector stays."""
    length = float(norm(vector))
    return vector / length if length > 0.0 else vector
