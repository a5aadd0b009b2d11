"""What a layer keeps free because the heights of a map are not exact.

A map of ``mbf map build`` states the standard error of its heights. The difference of two heights that are wrong
independently has sqrt(2) times that error, so a slope over a length L may be steeper than it is on the map by
atan(sqrt(2) error / L). Layers that judge slopes and steps take this off their limits. Layers that judge unevenness by
itself, such as ``roughness``, do not: errors of the heights make every surface rougher and none smoother.
"""

from __future__ import annotations

import math
from typing import TypeVar

from mbf_abstract.parameters import ParameterModel, parameter
from mbf_mesh_nav.map.layer import LayerParameters

Parameters = TypeVar("Parameters", bound=ParameterModel)


class HeightErrorParameters(LayerParameters):
    """Parameters of layers whose limits are narrower where heights are not exact."""

    height_error: float | None = parameter(
        None,
        "Standard error of the map's heights, which narrows the limits; absent = as the map file states, or 0.",
        unit="m",
        ge=0.0,
        le=1.0,
    )

    @property
    def step_error(self) -> float:
        """Standard error of the difference of two heights [m]."""
        return math.sqrt(2.0) * (self.height_error or 0.0)

    def slope_error(self, length: float) -> float:
        """Standard error [rad] of a slope between two places that are ``length`` [m] apart."""
        return math.atan(self.step_error / length)


def with_height_error(parameters: Parameters, height_error: float) -> Parameters:
    """Return parameters that have what the map file states [m] where they state nothing themselves."""
    if not isinstance(parameters, HeightErrorParameters) or parameters.height_error is not None:
        return parameters
    return parameters.model_copy(update={"height_error": height_error})
