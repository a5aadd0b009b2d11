"""Vertices inside polygons drawn on the map, seen from above and within a range of heights."""

from __future__ import annotations

import numpy as np
from pydantic import field_validator

from mbf_abstract.parameters import ParameterModel, parameter
from mbf_mesh_nav.kernels.polygons import inside_polygon
from mbf_mesh_nav.layer import FloatArray, LethalArray


class Region(ParameterModel):
    """A polygon on one storey."""

    polygon: tuple[tuple[float, float], ...] = parameter(..., "Corners (x, y) in the map's frame.", unit="m")
    z_min: float = parameter(-np.inf, "Lowest height the region applies to.", unit="m", allow_inf=True)
    z_max: float = parameter(np.inf, "Greatest height the region applies to.", unit="m", allow_inf=True)

    @field_validator("polygon")
    @classmethod
    def _has_an_inside(cls, polygon: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if len(polygon) < 3:
            raise ValueError(f"a polygon needs at least 3 corners, got {len(polygon)}")
        return polygon

    def mask(self, vertices: FloatArray) -> LethalArray:
        """Mask (V,) of the vertices (V, 3) inside, corners on the outline included by the even-odd rule."""
        inside = inside_polygon(vertices, np.array(self.polygon, dtype=np.float64))
        return np.asarray(inside & (vertices[:, 2] >= self.z_min) & (vertices[:, 2] <= self.z_max))
