"""The worlds that a scenario can take place in, one model each, in three families.

A ``TerrainWorld`` is a heightfield and can be driven on a mesh or a 2D map of its slopes; a ``BuildingWorld`` is a 2D
map whose occupied cells are walls; a ``LevelsWorld`` has several levels at one place, so only a mesh describes it.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from mbf_abstract.config.bounded_files import is_there
from mbf_abstract.config.findings import ConfigError, Finding, refused_at
from mbf_abstract.geometry import FloatArray, Pose
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.features import Feature, put_on
from terrain.scenarios.places import FARTHEST, Coordinate
from terrain.worlds.elevation_files import TerrainFileError, jacksboro, read_dem
from terrain.worlds.floor_plan import OFFICE_MAP, read_floor_plan
from terrain.worlds.generate import add_roughness, flat_terrain, fractal_terrain
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.mesh_world import MeshFileError, read_mesh_world
from terrain.worlds.multi_level import MultiLevelWorld, bridge_over_road, parking_garage
from terrain.worlds.occupancy import OccupancyGrid, read_occupancy
from terrain.worlds.slope_map import LETHAL_SLOPE
from terrain.worlds.surface import NO_SURFACE


class TerrainWorld(ParameterModel):
    """Open ground."""

    lethal_slope: float = parameter(
        LETHAL_SLOPE, "Ground steeper than this is an obstacle on the 2D map.", unit="deg", gt=5.0, lt=90.0
    )

    @abstractmethod
    def heightfield(self, rng: np.random.Generator, keep_clear: FloatArray) -> Heightfield:
        """Make or read the ground; what is drawn leaves the places ``keep_clear`` (n, 2) [m] free."""


class JacksboroWorld(TerrainWorld):
    """Real hills: the Jacksboro fault, shrunk isotropically."""

    type: Literal["jacksboro"]
    size: float = parameter(100.0, "Length along x.", unit="m", gt=1.0, le=1000.0)
    spacing: float | None = parameter(None, "Sample again at this distance; absent = the survey's own.", unit="m")
    roughness: float = parameter(
        0.0, "Root mean square height of small bumps added to the survey.", unit="m", ge=0.0, le=FARTHEST
    )

    def heightfield(self, rng: np.random.Generator, keep_clear: FloatArray) -> Heightfield:
        """Read the survey that comes with matplotlib."""
        with refused_at("scenario", "world", "spacing", expected="a distance of samples that the size allows"):
            return jacksboro(self.size, self.spacing, self.roughness, rng)


class GeneratedWorld(TerrainWorld):
    """Fractal hills drawn from the seed, with features on them."""

    type: Literal["generated"]
    size: tuple[float, float] = parameter((40.0, 30.0), "Length along x and y.", unit="m")
    spacing: float = parameter(0.25, "Distance of samples.", unit="m", gt=0.01, le=10.0)
    median_slope: float = parameter(0.0, "Median slope of the hills; 0 = level ground.", unit="deg", ge=0.0, lt=60.0)
    roughness: float = parameter(0.0, "Root mean square height of small bumps.", unit="m", ge=0.0, le=FARTHEST)
    features: tuple[Feature, ...] = parameter((), "Ridges, craters, ruts, roads, boulders, steps, in this order.")

    def heightfield(self, rng: np.random.Generator, keep_clear: FloatArray) -> Heightfield:
        """Draw the ground."""
        with refused_at("scenario", "world", "size", expected="a size that its hills fit into"):
            if self.median_slope > 0.0:
                terrain = fractal_terrain(*self.size, self.spacing, rng, self.median_slope, self.roughness)
            else:
                terrain = flat_terrain(*self.size, self.spacing)
                terrain = add_roughness(terrain, rng, self.roughness) if self.roughness > 0.0 else terrain
        for feature in self.features:
            terrain = put_on(terrain, feature, rng, keep_clear)
        return terrain


class HeightfieldWorld(TerrainWorld):
    """An elevation model from a file: GeoTIFF, ESRI ASCII, SRTM hgt or npz."""

    type: Literal["heightfield"]
    file: Path = parameter(..., "The file; its lower left corner becomes the origin.")
    crop: tuple[float, float, float, float] | None = parameter(
        None, "Keep only x_min, x_max, y_min, y_max of the file; the rest keeps its coordinates.", unit="m"
    )
    size: float | None = parameter(None, "Shrink or grow it isotropically to this length along x.", unit="m", gt=1.0)
    spacing: float | None = parameter(None, "Sample again at this distance.", unit="m", gt=0.01)

    def heightfield(self, rng: np.random.Generator, keep_clear: FloatArray) -> Heightfield:
        """Read the file."""
        with refused_at("scenario", "world", "file", expected="an elevation model", of=(TerrainFileError,)):
            terrain = read_dem(self.file)
        if self.crop is not None:
            with refused_at("scenario", "world", "crop", expected="a part of the file"):
                terrain = terrain.crop(*self.crop)
        if self.size is not None:
            terrain = terrain.scaled(self.size / terrain.size[0])
        with refused_at("scenario", "world", "spacing", expected="a distance of samples that the size allows"):
            return terrain if self.spacing is None else terrain.resample(self.spacing)


class BuildingWorld(ParameterModel):
    """A floor of a building."""

    @abstractmethod
    def grid(self) -> OccupancyGrid:
        """Return the floor's map."""

    def places(self) -> dict[str, Pose]:
        """Return free places with a name."""
        return {}


class OfficeWorld(BuildingWorld):
    """The office floor that comes with the package."""

    type: Literal["office"]

    def grid(self) -> OccupancyGrid:
        """Read the map."""
        return read_occupancy(OFFICE_MAP)

    def places(self) -> dict[str, Pose]:
        """Rooms of the floor plan."""
        return {name: Pose.planar(*place) for name, place in read_floor_plan().places.items()}


class MapWorld(BuildingWorld):
    """A building from a map_server map."""

    type: Literal["map"]
    file: Path = parameter(..., "The map's yaml file.")
    corner: tuple[Coordinate, Coordinate] | None = parameter(
        None,
        "Where the lower left corner of the map, or of the upright box around a rotated one, is put in the world; "
        "not given = as in the file.",
        unit="m",
    )

    def grid(self) -> OccupancyGrid:
        """Read the map."""
        if not is_there(self.file) or self.file.is_dir():
            raise ConfigError([Finding("scenario", 1, "world.file", "a map", f"no file {self.file}")])
        grid = read_occupancy(self.file)
        if self.corner is not None:
            return replace(grid, origin_x=self.corner[0], origin_y=self.corner[1])
        if max(abs(grid.origin_x), abs(grid.origin_y)) > FARTHEST:
            expected = f"a map within {FARTHEST:g} m of zero, or corner: [0, 0] in the scenario's world"
            raise ConfigError([Finding(str(self.file), 1, "origin", expected, f"{grid.origin_x}, {grid.origin_y}")])
        return grid


class LevelsWorld(ParameterModel):
    """Surfaces above each other."""

    @abstractmethod
    def levels(self) -> MultiLevelWorld:
        """Build or read the surfaces and the named places on them."""


class GarageWorld(LevelsWorld):
    """A parking garage with ramps."""

    type: Literal["garage"]
    floors: int = parameter(4, "Number of levels, the roof included.", ge=2, le=20)

    def levels(self) -> MultiLevelWorld:
        """Build the garage."""
        return parking_garage(self.floors)


class BridgeWorld(LevelsWorld):
    """A bridge over a road."""

    type: Literal["bridge"]

    def levels(self) -> MultiLevelWorld:
        """Build the bridge."""
        return bridge_over_road()


class MeshWorld(LevelsWorld):
    """Any triangle mesh; wheels roll on every face of it."""

    type: Literal["mesh"]
    file: Path = parameter(..., "The mesh file, in any format that the mesh server reads.")
    up_axis: Literal["", "x", "y", "z"] = parameter(
        "", "Axis of the file that points up; empty = as in the file or its format."
    )
    unit: float = parameter(0.0, "Length of the file's unit; 0 = as in the file, or 1.", unit="m", ge=0.0, le=1e6)

    def levels(self) -> MultiLevelWorld:
        """Read the file."""
        with refused_at("scenario", "world", "file", expected="a mesh to drive on", of=(MeshFileError,)):
            return MultiLevelWorld(read_mesh_world(self.file, self.up_axis, self.unit), NO_SURFACE, {})


World = Annotated[
    JacksboroWorld | GeneratedWorld | HeightfieldWorld | OfficeWorld | MapWorld | GarageWorld | BridgeWorld | MeshWorld,
    Field(discriminator="type"),
]
