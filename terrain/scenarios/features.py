"""Features that a scenario puts on generated ground, in the order they are listed."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from mbf_abstract.geometry import FloatArray
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.places import Coordinate, Offset
from terrain.worlds.generate import add_boulders, add_crater, add_ridge, add_road, add_ruts, add_steps
from terrain.worlds.heightfield import Heightfield

PlanarLine = Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=2)]


class Ridge(ParameterModel):
    """A ridge of Gaussian section along a line."""

    type: Literal["ridge"]
    points: PlanarLine = parameter(..., "Corners of its crest.", unit="m")
    height: Offset = parameter(..., "Of the crest above the ground; below 0 it is a trench.", unit="m")
    width: float = parameter(..., "From foot to foot.", unit="m", gt=0.0, le=10_000.0)


class Crater(ParameterModel):
    """A bowl with a raised rim."""

    type: Literal["crater"]
    x: Coordinate = parameter(..., "Position of its middle.", unit="m")
    y: Coordinate = parameter(..., "Position of its middle.", unit="m")
    radius: float = parameter(..., "From the middle to the crest of the rim.", unit="m", gt=0.0, le=10_000.0)
    depth: float = parameter(..., "Of the bowl below the ground.", unit="m", gt=0.0, le=10_000.0)
    rim: Offset | None = parameter(None, "Of the crest above the ground; absent = a fifth of the depth.", unit="m")


class Ruts(ParameterModel):
    """Two wheel ruts along a line."""

    type: Literal["ruts"]
    points: PlanarLine = parameter(..., "Corners of the line in their middle.", unit="m")
    track: float = parameter(1.5, "Distance of the ruts.", unit="m", gt=0.0, le=10_000.0)
    width: float = parameter(0.4, "Of one rut.", unit="m", gt=0.0, le=10_000.0)
    depth: float = parameter(0.15, "Of the ruts.", unit="m", gt=0.0, le=10_000.0)


class Road(ParameterModel):
    """A road that is level across; hairpins make a switchback."""

    type: Literal["road"]
    points: Annotated[tuple[tuple[Coordinate, Coordinate, Offset], ...], Field(min_length=2)] = parameter(
        ..., "Corners of its middle with heights.", unit="m"
    )
    width: float = parameter(3.0, "Of the level part.", unit="m", gt=0.0, le=10_000.0)
    shoulder: float = parameter(1.0, "Over which it fades into the ground on each side.", unit="m", gt=0.0, le=10_000.0)


class Boulders(ParameterModel):
    """Half-buried round boulders at places drawn from the seed; start and goals stay clear."""

    type: Literal["boulders"]
    density: float = parameter(5.0, "Boulders on 100 square metres.", ge=0.0, le=200.0)
    radius_min: float = parameter(0.1, "Smallest radius.", unit="m", gt=0.0, le=10_000.0)
    radius_max: float = parameter(0.8, "Largest radius.", unit="m", gt=0.0, le=10_000.0)

    @model_validator(mode="after")
    def _check_radii(self) -> Boulders:
        if self.radius_min > self.radius_max:
            got = f"{self.radius_min:g} and {self.radius_max:g}"
            raise ValueError(f"expected a radius_min of at most radius_max, got {got}")
        return self


class Steps(ParameterModel):
    """Stairs that rise along +x over the whole width of the world."""

    type: Literal["steps"]
    x: Coordinate = parameter(..., "Where the first step rises.", unit="m")
    height: float = parameter(0.15, "Of a step.", unit="m", gt=0.0, le=10_000.0)
    length: float = parameter(1.0, "Of a step.", unit="m", gt=0.0, le=10_000.0)
    count: int = parameter(1, "Number of steps.", ge=1, le=1000)


Feature = Annotated[Ridge | Crater | Ruts | Road | Boulders | Steps, Field(discriminator="type")]


def put_on(terrain: Heightfield, feature: Feature, rng: np.random.Generator, keep_clear: FloatArray) -> Heightfield:
    """Return the terrain with a feature; boulders are drawn from ``rng`` and leave the places (n, 2) [m] clear."""
    f = feature  # short, for the calls below
    if isinstance(f, Ridge):
        return add_ridge(terrain, f.points, f.height, f.width)
    if isinstance(f, Crater):
        return add_crater(terrain, f.x, f.y, f.radius, f.depth, f.rim)
    if isinstance(f, Ruts):
        return add_ruts(terrain, f.points, f.track, f.width, f.depth)
    if isinstance(f, Road):
        return add_road(terrain, f.points, f.width, f.shoulder)
    if isinstance(f, Boulders):
        return add_boulders(terrain, rng, f.density, f.radius_min, f.radius_max, keep_clear)
    return add_steps(terrain, f.x, f.height, f.length, f.count)
