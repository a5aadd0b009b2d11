"""Vertices inside polygons drawn on the map, seen from above and within a range of heights."""

from __future__ import annotations

import numpy as np
from pydantic import model_validator

from mbf_abstract.geometry.arithmetic import norm, scalar_products
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_abstract.maps.layers.drawn_area import DrawnArea
from mbf_abstract.parameters import parameter
from mbf_mesh_nav.arrays import FloatArray, IntArray
from mbf_mesh_nav.map.layer import LethalArray

ON_OUTLINE = 1e-6
"""A vertex this near [m] to a side of a polygon lies on it."""
CORNER_SHARE = 1e-6
"""Distance of a probe point from its corner, in lengths of the side."""


class Region(DrawnArea):
    """A polygon on one storey."""

    z_min: float = parameter(-np.inf, "Lowest height the region applies to.", unit="m", allow_inf=True)
    z_max: float = parameter(np.inf, "Greatest height the region applies to.", unit="m", allow_inf=True)

    @model_validator(mode="after")
    def _has_a_height(self) -> Region:
        if self.z_min > self.z_max:
            raise ValueError(f"a range of heights: z_min {self.z_min:g} m is above z_max {self.z_max:g} m")
        return self

    def mask(self, vertices: FloatArray) -> LethalArray:
        """Mask (V,) of the vertices (V, 3) inside, corners on the outline included by the even-odd rule."""
        inside = inside_polygon(vertices, self.corners)
        return np.asarray(inside & self._within_heights(vertices))

    def closed_mask(self, vertices: FloatArray, edges: IntArray, faces: IntArray) -> LethalArray:
        """Like ``mask``, and what closes the region between vertices: no edge between others passes through it.

        All vertices on the outline are added, both ends of an edge (E, 2) that crosses the outline without an end
        inside, and the corners of a face (F, 3) into which a corner of the polygon leads.
        """
        outline = self.corners
        mask = self.mask(vertices) | (_on_outline(vertices, outline) & self._within_heights(vertices))
        low, high = outline.min(axis=0), outline.max(axis=0)
        flat, at_height = vertices[:, :2], self._within_heights(vertices)
        outside = edges[~mask[edges].any(axis=1) & at_height[edges].any(axis=1)]
        ends = flat[outside]
        outside = outside[((ends.max(axis=1) >= low) & (ends.min(axis=1) <= high)).all(axis=1)]
        for begin, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            crossing = _segments_cross(flat[outside[:, 0]], flat[outside[:, 1]], begin, end)
            mask[outside[crossing].ravel()] = True
        around = faces[~mask[faces].any(axis=1) & at_height[faces].any(axis=1)]
        for corner in np.concatenate([outline, *_beside_corners(outline)]):
            a, b, c = (flat[around[:, k]] for k in range(3))
            sides = [_side_of(p, q, corner) for p, q in ((a, b), (b, c), (c, a))]
            covers = np.all([side > 0.0 for side in sides], axis=0) | np.all([side < 0.0 for side in sides], axis=0)
            mask[around[covers].ravel()] = True
        return mask

    def _within_heights(self, vertices: FloatArray) -> LethalArray:
        return np.asarray((vertices[:, 2] >= self.z_min) & (vertices[:, 2] <= self.z_max))


def _side_of(p: FloatArray, q: FloatArray, point: FloatArray) -> FloatArray:
    """Positive where a point lies to the left of the line from p to q, all (..., 2)."""
    along, to_point = q - p, point - p
    return np.asarray(along[..., 0] * to_point[..., 1] - along[..., 1] * to_point[..., 0])


def _on_outline(vertices: FloatArray, outline: FloatArray) -> LethalArray:
    """Mask (V,) of the vertices (V, 3) that lie, seen from above, on a side of the polygon ``outline`` (n, 2)."""
    flat, mask = vertices[:, :2], np.zeros(len(vertices), dtype=np.bool_)
    for begin, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        side = end - begin
        share = np.clip(scalar_products(flat - begin, side) / max(float(scalar_products(side, side)), 1e-30), 0.0, 1.0)
        mask |= norm(flat - begin - share[:, None] * side) <= ON_OUTLINE
    return mask


def _beside_corners(outline: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) on the sides of a polygon, just after and before its corners.

    A corner may lie on an edge of the mesh: these points find the faces the polygon enters there.
    """
    sides = np.roll(outline, -1, axis=0) - outline
    return outline + CORNER_SHARE * sides, outline + (1.0 - CORNER_SHARE) * sides


def _segments_cross(p: FloatArray, q: FloatArray, begin: FloatArray, end: FloatArray) -> LethalArray:
    """Which of the segments pq (n, 2) cross the one from ``begin`` to ``end`` (2,); to touch it is not enough."""
    across = _side_of(p, q, begin) * _side_of(p, q, end) < 0.0
    along = _side_of(begin, end, p) * _side_of(begin, end, q) < 0.0
    return np.asarray(across & along)
