"""The robot's outline in the plane: parsing, radii, padding and true offset.

There are two kinds of enlarged outlines:

- ``padded`` is costmap_2d's ``footprint_padding``: every vertex moves by the padding along x and along y, away from
  the base's axes. It keeps the number of vertices and is what users' configurations mean. It is not an offset: the
  sides of a slanted outline move by a distance other than the padding.
- ``offset`` keeps at least the given distance from the outline everywhere. Safety distances use it.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mbf_abstract.geometry.arithmetic import norm, plane_rotation, rotated, scalar_products
from mbf_costmap_nav.grid.outline_check import outline_problem

FloatArray = NDArray[np.float64]

OUTLINES_KEPT = 32
"""So many offset outlines are kept: plans and motions ask for those of a few robots again and again."""
CIRCLE_POINTS = 16
AS_A_CIRCLE = 1.02
"""An outline whose radii differ by no more than this factor, which is that of 16 corners, stands for a circle."""
FARTHEST_CORNER = 1e6
"""[m] along x and y; whatever unit was meant, squares of it do not overflow."""
MITRE_LIMIT = 2.0
"""A corner of an offset outline may stick out by this factor of the distance; sharper ones are cut off flat."""


class Footprint:
    """A simple polygon around the base's origin, in the base frame.

    Attributes
    ----------
    vertices : (n, 2) float64, read-only
        Corners [m] in order (either orientation), x forward, y left. Fewer than three points stand for a robot that is
        a point: only the cell of its centre counts.
    inscribed_radius : float
        Distance [m] from the base to the nearest side; the largest float for fewer than three points (costmap_2d).
    circumscribed_radius : float
        Distance [m] from the base to the farthest corner; 0 for fewer than three points (costmap_2d).

    Raises
    ------
    ValueError
        The vertices are not an (n, 2) array of finite numbers, or farther away than FARTHEST_CORNER.
    """

    __slots__ = ("circumscribed_radius", "inscribed_radius", "vertices")

    def __init__(self, vertices: ArrayLike) -> None:
        points = np.array(vertices, dtype=np.float64)
        if points.size == 0:
            points = points.reshape(0, 2)
        if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise ValueError(f"a list of finite [x, y] points, not one of shape {points.shape}")
        if (np.abs(points) > FARTHEST_CORNER).any():
            raise ValueError(f"corners within {FARTHEST_CORNER:g} m of the base, not {np.abs(points).max():g} m away")
        points.flags.writeable = False
        self.vertices: FloatArray = points
        self.inscribed_radius, self.circumscribed_radius = _radii(points)

    @classmethod
    def circle(cls, radius: float) -> Footprint:
        """Footprint of a round robot: 16 points on the circle of ``radius`` [m], the first at (radius, 0)."""
        angles = np.arange(CIRCLE_POINTS) * (2.0 * math.pi / CIRCLE_POINTS)
        return cls(radius * np.column_stack([np.cos(angles), np.sin(angles)]))

    @property
    def is_circle(self) -> bool:
        """Whether it stands for a circle around the base, as that of ``circle`` does."""
        return len(self.vertices) >= 3 and self.circumscribed_radius <= AS_A_CIRCLE * self.inscribed_radius

    @classmethod
    def parse(cls, value: str | Sequence[Sequence[float]]) -> Footprint:
        """Read ``"[[x, y], ...]"`` or a list of pairs.

        Raises
        ------
        ValueError
            The text is no list of pairs of numbers, has fewer than three points, or they are no outline around the
            base: sides cross, there is no area, or (0, 0) lies outside.
        """
        points = parse_number_lists(value) if isinstance(value, str) else value
        for i, point in enumerate(points):
            if len(point) != 2:
                raise ValueError(f"point {i} of the footprint needs two numbers, got {list(point)}")
        if len(points) < 3:
            raise ValueError(f"expected a footprint of at least 3 points, got {len(points)}")
        footprint = cls(points)
        if problem := outline_problem(footprint.vertices):
            raise ValueError(problem)
        return footprint

    def at(self, x: float, y: float, yaw: float) -> FloatArray:
        """Vertices (n, 2) [m] with the base at (x, y) [m], rotated by ``yaw`` [rad]."""
        return np.asarray(rotated(plane_rotation(yaw), self.vertices) + np.array([x, y]))

    def padded(self, padding: float) -> Footprint:
        """Move each vertex by ``padding`` [m] along x and y, by the sign of its coordinate (costmap_2d)."""
        return Footprint(self.vertices + padding * np.sign(self.vertices))

    def offset(self, distance: float) -> Footprint:
        """Outline that keeps ``distance`` [m], 0 or more, from this one.

        The sides move outwards by exactly ``distance`` and meet in corners; a corner sharper than ``MITRE_LIMIT`` is
        cut flat, still outside the rounded offset. A footprint that is not convex is replaced by its convex hull,
        which is larger and therefore safe. A point robot becomes a circle.

        Raises
        ------
        ValueError
            The distance is negative or not finite.
        """
        if not 0.0 <= distance < math.inf:
            raise ValueError(f"the distance of an offset must be 0 m or more and finite, got {distance} m")
        if distance == 0.0:
            return self
        if len(self.vertices) < 3:
            return Footprint.circle(distance / math.cos(math.pi / CIRCLE_POINTS))
        return _offset(self.vertices.tobytes(), distance)


def parse_number_lists(text: str) -> list[list[float]]:
    """Parse ``"[[1, 2.2], [.3, -4e4]]"``, a list of lists of numbers.

    Raises
    ------
    ValueError
        Unbalanced brackets, another depth than two, or something that is not a finite number.
    """
    try:
        rows = json.loads(_with_leading_zeros(text))
    except json.JSONDecodeError as error:
        raise ValueError(f"expected a list like [[x, y], ...], got {text!r}: {error.msg}") from None
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
        raise ValueError(f"expected a list of lists of numbers, got {text!r}")
    for row in rows:
        for number in row:
            if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
                raise ValueError(f"expected finite numbers only, got {number!r} in {text!r}")
    return [[float(number) for number in row] for row in rows]


def _with_leading_zeros(text: str) -> str:
    """Write ``.3`` and ``-.3`` as JSON wants them, 0.3 and -0.3."""
    out = []
    for i, character in enumerate(text):
        if character == "." and (i == 0 or not text[i - 1].isdigit()):
            out.append("0")
        out.append(character)
    return "".join(out)


def _radii(points: FloatArray) -> tuple[float, float]:
    """Nearest side and farthest corner seen from the origin (costmap_2d's calculateMinAndMaxDistances)."""
    if len(points) < 3:
        return sys.float_info.max, 0.0
    ends = np.roll(points, -1, axis=0)
    sides = ends - points
    lengths_squared = np.maximum(np.sum(sides**2, axis=1), 1e-30)
    along = np.clip(-np.sum(points * sides, axis=1) / lengths_squared, 0.0, 1.0)
    nearest = points + along[:, None] * sides
    return float(norm(nearest).min()), float(norm(points).max())


@lru_cache(maxsize=OUTLINES_KEPT)
def _offset(vertices: bytes, distance: float) -> Footprint:
    """Footprint that keeps ``distance`` [m] from one of three corners or more, the bytes of (n, 2) float64."""
    hull = _convex_hull(np.frombuffer(vertices).reshape(-1, 2))
    if len(hull) == 1:
        x, y = hull[0]
        return Footprint(np.add(Footprint([]).offset(distance).vertices, (x, y)))
    return Footprint(_mitred_offset(hull, distance))


def _convex_hull(points: FloatArray) -> FloatArray:
    """Corners of the hull, counter-clockwise, merged within a nanometre (monotone chain, Andrew 1979)."""
    ordered = np.unique(np.round(points, 9), axis=0)
    if len(ordered) < 3:
        return ordered
    chains: list[list[FloatArray]] = []
    for run in (ordered, ordered[::-1]):
        chain: list[FloatArray] = []
        for point in run:
            while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Twice the area of the triangle; positive if a, b, c turn left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _mitred_offset(hull: FloatArray, distance: float) -> FloatArray:
    """Offset a counter-clockwise convex polygon, or a segment, outwards by moving its sides."""
    sides = np.roll(hull, -1, axis=0) - hull
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / norm(sides)[:, None]
    corners: list[FloatArray] = []
    for vertex, before, after in zip(hull, np.roll(normals, 1, axis=0), normals, strict=True):
        between = before + after
        length = float(norm(between))
        # At the end of a segment the sides run back on themselves; outwards is then straight on.
        bisector = between / length if length > 1e-9 else np.array([-before[1], before[0]])
        half_turn_cosine = float(scalar_products(bisector, before))
        if half_turn_cosine * MITRE_LIMIT >= 1.0:
            corners.append(vertex + bisector * (distance / half_turn_cosine))
            continue
        # Cut the corner by the line across the bisector that still touches the circle of the distance.
        tangent = np.array([-bisector[1], bisector[0]])
        half_cut = distance * (1.0 - half_turn_cosine) / math.sqrt(1.0 - half_turn_cosine**2)
        corners.append(vertex + bisector * distance - tangent * half_cut)
        corners.append(vertex + bisector * distance + tangent * half_cut)
    return np.array(corners)
