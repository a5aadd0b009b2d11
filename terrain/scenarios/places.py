"""Places in a scenario: coordinates, or the name of a place that the world knows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from mbf_abstract.config.findings import ConfigError, Finding
from mbf_abstract.geometry import FARTHEST_COORDINATE, FloatArray
from mbf_abstract.parameters import ParameterModel, parameter

FARTHEST = 10_000.0
"""Coordinates [m] up to which the physics, in single precision, resolves a millimetre."""
FULL_TURN = 6.2832
"""Largest heading [rad]; what is beyond was meant in degrees."""

Coordinate = Annotated[float, Field(ge=-FARTHEST_COORDINATE, le=FARTHEST_COORDINATE)]
"""A place along an axis [m]; one that is only too far from the world is reported as off the ground."""
Offset = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
"""A length in one of two directions, such as up and down [m]."""


class PlanarPose(ParameterModel):
    """A place on the ground."""

    x: Coordinate = parameter(..., "Position.", unit="m")
    y: Coordinate = parameter(..., "Position.", unit="m")
    yaw: float = parameter(0.0, "Heading.", unit="rad", ge=-FULL_TURN, le=FULL_TURN)
    z: Coordinate | None = parameter(None, "Offset of the level that is meant; absent = the highest ground.", unit="m")


Place = PlanarPose | str


def _in_order(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] > interval[1]:
        raise ValueError(f"expected two numbers, the smaller first, got {interval[0]:g}, {interval[1]:g}")
    return interval


Interval = Annotated[tuple[Coordinate, Coordinate], AfterValidator(_in_order)]


def coordinates(places: Iterable[Place | None]) -> FloatArray:
    """Return (n, 2) x and y [m] of the places that are given by coordinates."""
    return np.array([(place.x, place.y) for place in places if isinstance(place, PlanarPose)]).reshape(-1, 2)


def off_the_ground(key: str, x: float, y: float) -> ConfigError:
    """Return the error about a ``key`` of the scenario that has no ground at (x, y) [m]."""
    far = max(abs(x), abs(y)) > FARTHEST
    hint = "metres from the corner of the world are meant, not coordinates of a survey" if far else ""
    expected, got = "a place on the ground of the world", f"({x:.10g}, {y:.10g})"
    return ConfigError([Finding("scenario", 1, key, expected, got, hint)])
