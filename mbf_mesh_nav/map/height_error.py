"""What a layer keeps free because the heights of a map are not exact.

A map of ``mbf map build`` states the standard error of the height of each vertex, and of places on the faces around it,
where noise is the mean of that of three vertices; maps of earlier versions have one number for all. The difference of
two heights that are wrong independently has sqrt(2) times that error, so a slope over a length L may be steeper than it
is on the map by atan(sqrt(2) error / L). Layers that judge slopes and steps take this off their limits. Layers that
judge unevenness by itself, such as ``roughness``, do not: errors of the heights make every surface rougher and none
smoother.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from mbf_abstract.geometry.arithmetic import arctan
from mbf_abstract.maps.layers.error_margin import ErrorMargin
from mbf_abstract.parameters import ParameterModel, parameter
from mbf_mesh_nav.arrays import FloatArray
from mbf_mesh_nav.map.layer import LayerParameters, MeshLayer

Parameters = TypeVar("Parameters", bound=ParameterModel)
Errors = float | FloatArray
"""One standard error [m] for all places, or one for each."""


class HeightErrorParameters(LayerParameters, ErrorMargin):
    """Parameters of layers whose limits are narrower where heights are not exact."""

    height_error: float | None = parameter(
        None,
        "Standard error of the map's heights, which narrows the limits, the same everywhere; absent = as the map file "
        "states for each vertex or for all, or 0.",
        unit="m",
        ge=0.0,
        le=1.0,
    )


def errors_for(layer: MeshLayer) -> Errors:
    """Error of the heights [m] that a layer counts with: its margin times what is configured or the map states (V,)."""
    stated = layer.parameters.height_error if isinstance(layer.parameters, HeightErrorParameters) else None
    if stated is None and layer.height_errors is not None:
        return _within_margin(layer, layer.height_errors)
    return _within_margin(layer, stated or 0.0)


def place_errors_for(layer: MeshLayer) -> Errors:
    """As ``errors_for``, of places on the faces around the vertices, where wheels stand."""
    errors = errors_for(layer)
    if isinstance(errors, float) or layer.place_errors is None:
        return errors
    return _within_margin(layer, layer.place_errors)


def _within_margin(layer: MeshLayer, errors: Errors) -> Errors:
    """Standard errors [m] times the margin of a layer."""
    margin = layer.parameters.error_margin if isinstance(layer.parameters, HeightErrorParameters) else 1.0
    return errors if margin == 1.0 else margin * errors


def usual_error(errors: Errors) -> float:
    """The median of errors [m], which few bad places do not change."""
    return errors if isinstance(errors, float) else float(np.median(errors))


def step_error(errors: Errors) -> Errors:
    """Standard error of the difference of two heights [m]."""
    return math.sqrt(2.0) * errors


def narrowed(limit: float, errors: Errors, least: float) -> Errors:
    """A limit less its errors, at least ``least``; a plain number for one error, which keeps layers in four bytes."""
    rest = limit - errors
    return max(rest, least) if isinstance(rest, float) else np.maximum(rest, least)


def slope_error(errors: Errors, length: float) -> Errors:
    """Standard error [rad] of a slope between two places that are ``length`` [m] apart."""
    return angle_of(step_error(errors) / length)


def angle_of(slopes: Errors) -> Errors:
    """Arc tangent [rad] of one slope or of many, the same on every CPU."""
    return math.atan(slopes) if isinstance(slopes, float) else arctan(slopes)


def with_height_error(parameters: Parameters, height_error: float | None) -> Parameters:
    """Return parameters that have what the map file states of all heights [m] where they state nothing themselves."""
    if not isinstance(parameters, HeightErrorParameters) or parameters.height_error is not None:
        return parameters
    return parameters.model_copy(update={"height_error": height_error})
