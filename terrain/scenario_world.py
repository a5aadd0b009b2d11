"""From a scenario's world to physics, and to the two files a navigation configuration may ask for.

A run writes its world as ``world.ply`` (the very triangles Bullet collides with) and, where a 2D map can describe it,
``world.yaml`` + ``world.png`` (a map_server map), so every server gets the map it can read, and a configuration never
sees the simulator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.findings import ConfigError, Finding
from mbf_abstract.geometry import FloatArray, Pose
from terrain.actors import Actor, AnyWorld
from terrain.floor_plan import write_map
from terrain.heightfield import Heightfield
from terrain.indoor import add_building
from terrain.kinematic_robot import KinematicWorld
from terrain.occupancy import OccupancyGrid, wall_triangles
from terrain.recording import Surface
from terrain.scenario_places import Place
from terrain.scenario_world_types import BuildingWorld, LevelsWorld, TerrainWorld
from terrain.shortest_way import free_floor
from terrain.slope_map import slope_grid, write_slope_map
from terrain.world import TIME_STEP, BulletWorld

STOREY = 1.0  # m; height of the walls in the mesh of a building
MESH_CELL = 0.1  # m; edge length of that mesh

Physics = TypeVar("Physics", BulletWorld, AnyWorld)
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

    def open_surface(self) -> Surface:
        """Return what a robot may drive on: the ground, in a building only its free cells."""
        return self.ground if self.grid is None or self.walls is None else free_floor(self.grid)

    def pose_of(self, place: Place) -> Pose:
        """Return the pose on the ground that a place means, upright; raises ConfigError for an unknown name."""
        if isinstance(place, str):
            if place not in self.places:
                known = ", ".join(self.places) or "none"
                raise ConfigError([Finding("scenario", 1, "start or goals", f"a place of the world ({known})", place)])
            return self.places[place]
        z = self.height_at(place.x, place.y) if place.z is None else place.z
        return Pose.planar(place.x, place.y, place.yaw, z)


def build_world(
    world: TerrainWorld | BuildingWorld | LevelsWorld,
    folder: Path,
    rng: np.random.Generator,
    keep_clear: FloatArray,
    time_step: float = TIME_STEP,
    kinematic: bool = False,
) -> ScenarioWorld:
    """Put a world into Bullet, or into its stand-in without physics, and write its map files into ``folder``.

    Parameters
    ----------
    keep_clear : (n, 2) float
        Places [m] on which nothing that is drawn may stand.
    time_step : float
        Of the physics [s].
    kinematic : bool
        Whether robots follow commands exactly; impossible on several levels.
    """

    def physics(terrain: Heightfield | None = None, building: OccupancyGrid | None = None) -> AnyWorld:
        return KinematicWorld(terrain, building) if kinematic else BulletWorld(time_step)

    if isinstance(world, TerrainWorld):
        terrain = world.heightfield(rng, keep_clear)
        return _built(physics(terrain), partial(_build_terrain, terrain, world.lethal_slope, folder))
    if isinstance(world, BuildingWorld):
        grid = world.grid()
        return _built(physics(building=grid), partial(_build_building, world, grid, folder))
    if kinematic:
        raise ValueError("a robot without physics needs a world with one level")
    return _built(BulletWorld(time_step), partial(_build_levels, world, folder))


def _built(physics: Physics, build: Callable[[Physics], ScenarioWorld]) -> ScenarioWorld:
    """Build into ``physics``, which is closed if that fails."""
    try:
        return build(physics)
    except BaseException:
        physics.close()
        raise


def _build_terrain(terrain: Heightfield, lethal_slope: float, folder: Path, physics: AnyWorld) -> ScenarioWorld:
    if isinstance(physics, BulletWorld):
        physics.add_heightfield(terrain)
    ground, resolution = Surface(*terrain.triangles()), min(terrain.dx, terrain.dy)
    files = _write_files(ground, folder)
    files["$WORLD_MAP"] = write_slope_map(terrain, folder, "world", resolution, lethal_slope)
    grid = slope_grid(terrain, resolution, lethal_slope)
    return ScenarioWorld(physics, files, lambda x, y: float(terrain.height_at(x, y)), ground, None, grid)


def _build_building(world: BuildingWorld, grid: OccupancyGrid, folder: Path, physics: AnyWorld) -> ScenarioWorld:
    if isinstance(physics, BulletWorld):
        add_building(physics, grid)
    files = _write_files(Surface(*storey_heights(grid).triangles()), folder, grid)
    walls = Surface(*wall_triangles(grid))
    return ScenarioWorld(physics, files, lambda x, y: 0.0, _floor_surface(grid), walls, grid, world.places())


def _build_levels(world: LevelsWorld, folder: Path, physics: BulletWorld) -> ScenarioWorld:
    levels = world.levels()
    physics.add_mesh(levels.ground.vertices, levels.ground.faces)
    ground, walls = Surface(levels.ground.vertices, levels.ground.faces), None
    if len(levels.walls.faces):
        physics.add_mesh(levels.walls.vertices, levels.walls.faces, ground=False)
        walls = Surface(levels.walls.vertices, levels.walls.faces)

    def height_at(x: float, y: float) -> float:
        return float(physics.vertical_rays([(x, y)])[0])

    return ScenarioWorld(physics, _write_files(ground, folder), height_at, ground, walls, places=levels.places)


def _write_files(ground: Surface, folder: Path, grid: OccupancyGrid | None = None) -> dict[str, Path]:
    files = {"$WORLD_MESH": write_mesh(ground.vertices, ground.faces, folder / "world.ply")}
    if grid is not None:
        files["$WORLD_MAP"] = write_map(grid, folder, "world")
    return files


def storey_heights(grid: OccupancyGrid) -> Heightfield:
    """Turn a floor into a heightfield: walls and unknown cells are blocks on a level floor."""
    step = max(1, round(MESH_CELL / grid.resolution))
    solid = ~grid.free
    ny, nx = (size // step * step for size in solid.shape)
    blocks = solid[:ny, :nx].reshape(ny // step, step, nx // step, step).any(axis=(1, 3))
    spacing, half = step * grid.resolution, 0.5 * step * grid.resolution
    heights = np.where(blocks, np.float32(STOREY), np.float32(0.0))
    return Heightfield(heights, spacing, spacing, grid.origin_x + half, grid.origin_y + half)


def write_mesh(vertices: FloatArray, faces: NDArray[np.int32], file: Path) -> Path:
    """Write triangles as a PLY file with double precision, the same surface to the last bit."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    file.write_bytes(header.encode() + np.ascontiguousarray(vertices, dtype="<f8").tobytes() + rows.tobytes())
    return file


def _floor_surface(grid: OccupancyGrid) -> Surface:
    x_min, x_max, y_min, y_max = grid.bounds
    corners = np.array([[x_min, y_min, 0.0], [x_max, y_min, 0.0], [x_max, y_max, 0.0], [x_min, y_max, 0.0]])
    return Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
