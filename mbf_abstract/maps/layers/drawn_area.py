"""Areas that people draw on a map: a polygon with a name, as layers of every map take them."""

from __future__ import annotations

import numpy as np
from pydantic import field_validator

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.polygon import area_warning
from mbf_abstract.parameters import ParameterModel, parameter


class DrawnArea(ParameterModel):
    """One polygon, seen from above."""

    name: str = parameter("", "Name for messages; empty = its place in the list.")
    polygon: tuple[tuple[float, float], ...] = parameter(
        ..., "Corners (x, y) in order, at least three, in the map's frame unless the layer names another.", unit="m"
    )

    @field_validator("polygon")
    @classmethod
    def _has_an_inside(cls, polygon: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if len(polygon) < 3:
            raise ValueError(f"a polygon of at least 3 corners, not of {len(polygon)}")
        return polygon

    @property
    def corners(self) -> FloatArray:
        """Corners (n, 2) [m]."""
        return np.array(self.polygon, dtype=np.float64)

    def warning(self) -> str:
        """What of the polygon is hardly meant; empty if nothing is."""
        return area_warning(self.corners)

    def title(self, key: str, index: int) -> str:
        """What messages call it: its name, or ``key[index]``, its place in the configuration."""
        return f"{self.name!r}" if self.name else f"{key}[{index}]"
