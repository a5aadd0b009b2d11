"""From a scenario's world to physics, and to the map files a navigation configuration may ask for.

Every server gets the map it can read from ``terrain.worlds.map_files``, and a configuration never sees the simulator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mbf_abstract.config.findings import ConfigError, Finding, refused_at
from mbf_abstract.geometry import FloatArray, Pose
from terrain.physics.actors import AnyWorld, RouteWalker
from terrain.physics.kinematic_world import KinematicWorld
from terrain.physics.people import Person
from terrain.physics.protocols import Actor, SimulatedRobot
from terrain.physics.world import TIME_STEP, BulletWorld
from terrain.scenarios.places import Place, off_the_ground
from terrain.scenarios.world_types import BuildingWorld, LevelsWorld, TerrainWorld
from terrain.worlds.geodesics import free_floor
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.map_files import MapFiles
from terrain.worlds.occupancy import OccupancyGrid, wall_surface
from terrain.worlds.slope_map import slope_grid
from terrain.worlds.surface import Surface, level_rectangle

HeightAt = Callable[[float, float], float]


@dataclass(frozen=True)
class ScenarioWorld:
    """A scenario's world, built.

    Attributes
    ----------
    physics : BulletWorld or KinematicWorld
        What steps it.
    files : dict of str to Path
        Placeholder of a navigation configuration -> the file that stands for it.
    height_at : callable
        Height of the highest ground [m] at (x, y).
    grid : OccupancyGrid or None
        2D map of it, where there is one.
    places : mapping of str to Pose
        Places with a name.
    actors : list of Actor
        What moves by itself; a scenario adds them.
    """

    physics: AnyWorld
    files: dict[str, Path]
    height_at: HeightAt
    ground: Surface
    walls: Surface | None = None
    grid: OccupancyGrid | None = None
    places: Mapping[str, Pose] = field(default_factory=dict)
    actors: list[Actor] = field(default_factory=list)

    def introduce(self, robots: Sequence[SimulatedRobot]) -> None:
        """Make the robots that navigate, people and other robots known to each other, as far as they yield."""
        walking = [actor for actor in self.actors if isinstance(actor, RouteWalker | Person)]
        for actor in walking:
            if isinstance(actor, Person):
                actor.meet(robots, walking)
            else:
                actor.meet(robots)

    def open_surface(self) -> Surface:
        """Return what a robot may drive on: the ground, in a building only its free cells."""
        return self.ground if self.grid is None or self.walls is None else free_floor(self.grid)

    def has_wall_at(self, pose: Pose) -> bool:
        """Whether a pose lies inside a wall of a building; False in other worlds."""
        return self.walls is not None and self.grid is not None and self.grid.is_occupied(pose.x, pose.y)

    def ground_at(self, x: float, y: float) -> float:
        """Height of the highest ground [m] at (x, y), not finite where there is none: in a building, off its map."""
        return math.nan if self._is_off_the_map(x, y) else self.height_at(x, y)

    def _is_off_the_map(self, x: float, y: float) -> bool:
        return self.grid is not None and not self.grid.covers(x, y)

    def pose_of(self, place: Place) -> Pose:
        """Return the pose on the ground that a place means, upright.

        Raises
        ------
        ConfigError
            The world has no place of this name, or no ground there: in a building, off its floor plan.
        """
        if isinstance(place, str):
            if place not in self.places:
                known = ", ".join(self.places) or "none"
                raise ConfigError([Finding("scenario", 1, "start or goals", f"a place of the world ({known})", place)])
            return self.places[place]
        z = self.ground_at(place.x, place.y) if place.z is None else place.z
        if not math.isfinite(z) or self._is_off_the_map(place.x, place.y):
            raise off_the_ground("start or goals", place.x, place.y)
        return Pose.planar(place.x, place.y, place.yaw, z)


def build_world(
    world: TerrainWorld | BuildingWorld | LevelsWorld,
    files: MapFiles,
    rng: np.random.Generator,
    keep_clear: FloatArray,
    time_step: float = TIME_STEP,
    kinematic: bool = False,
) -> ScenarioWorld:
    """Put a world into Bullet, or into its stand-in without physics, and write its map files.

    Parameters
    ----------
    files : MapFiles
        Writes the maps.
    keep_clear : (n, 2) float
        Places [m] on which nothing that is drawn may stand.
    time_step : float
        Of the physics [s].
    kinematic : bool
        Whether robots follow commands exactly; impossible on several levels.
    """
    physics: AnyWorld
    if isinstance(world, TerrainWorld):
        terrain = world.heightfield(rng, keep_clear)
        physics = KinematicWorld(terrain) if kinematic else BulletWorld(time_step)
        with _closed_if_that_fails(physics):
            return _build_terrain(terrain, world.lethal_slope, files, physics)
    if isinstance(world, BuildingWorld):
        grid = world.grid()
        physics = KinematicWorld(building=grid) if kinematic else BulletWorld(time_step)
        with _closed_if_that_fails(physics):
            return _build_building(world, grid, files, physics)
    if kinematic:
        raise ValueError("a robot without physics needs a world with one level")
    physics = BulletWorld(time_step)
    with _closed_if_that_fails(physics):
        return _build_levels(world, files, physics)


@contextmanager
def _closed_if_that_fails(physics: AnyWorld) -> Iterator[None]:
    try:
        yield
    except BaseException:
        physics.close()
        raise


def _build_terrain(terrain: Heightfield, lethal_slope: float, files: MapFiles, physics: AnyWorld) -> ScenarioWorld:
    if isinstance(physics, BulletWorld):
        with refused_at("scenario", "world", expected="ground that the physics can hold"):
            physics.add_heightfield(terrain)
    ground, resolution = terrain.surface(), min(terrain.dx, terrain.dy)
    written = files.of_terrain(terrain, lethal_slope)
    grid = slope_grid(terrain, resolution, lethal_slope)
    return ScenarioWorld(physics, written, lambda x, y: float(terrain.height_at(x, y)), ground, None, grid)


def _build_building(world: BuildingWorld, grid: OccupancyGrid, files: MapFiles, physics: AnyWorld) -> ScenarioWorld:
    if isinstance(physics, BulletWorld):
        physics.add_building(grid)
    walls = wall_surface(grid) if grid.occupied.any() else None
    return ScenarioWorld(
        physics, files.of_building(grid), lambda x, y: 0.0, level_rectangle(*grid.bounds), walls, grid, world.places()
    )


def _build_levels(world: LevelsWorld, files: MapFiles, physics: BulletWorld) -> ScenarioWorld:
    levels = world.levels()
    levels.add_to(physics)
    walls = levels.walls if len(levels.walls.faces) else None

    def height_at(x: float, y: float) -> float:
        return float(physics.vertical_rays([(x, y)])[0])

    files_of_map = files.of_levels(levels.ground)
    return ScenarioWorld(physics, files_of_map, height_at, levels.ground, walls, places=levels.places)
