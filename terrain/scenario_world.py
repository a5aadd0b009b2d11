"""From a scenario's world to physics, and to the two files a navigation configuration may ask for.

A run writes its world as ``world.ply`` (the very triangles Bullet collides with) and ``world.yaml`` + ``world.png`` (a
map_server map), so every server gets the map it can read, and a configuration never sees the simulator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray, Pose
from terrain.dem_io import jacksboro
from terrain.floor_plan import OFFICE_MAP, write_map
from terrain.heightfield import Heightfield
from terrain.indoor import add_building
from terrain.occupancy import OccupancyGrid, read_occupancy, wall_triangles
from terrain.recording import Surface
from terrain.scenario import JacksboroWorld, Obstacle, OfficeWorld, Scenario
from terrain.solids import box_triangles, cylinder_triangles
from terrain.world import BulletWorld

MAX_SLOPE = 30.0  # degrees; steeper ground is an obstacle on a 2D map of a terrain
BORDER = 2  # cells at a terrain's edge that a 2D map shows as obstacles
STOREY = 1.0  # m; height of the walls in the mesh of a building
MESH_CELL = 0.1  # m; edge length of that mesh

HeightAt = Callable[[float, float], float]


@dataclass(frozen=True)
class ScenarioWorld:
    """A scenario's world, built.

    Attributes
    ----------
    files : dict of str to Path
        Placeholder of a navigation configuration -> the file that stands for it.
    height_at : callable
        Height of the ground [m] at (x, y).
    """

    bullet: BulletWorld
    files: dict[str, Path]
    height_at: HeightAt
    ground: Surface
    walls: Surface | None
    obstacles: Surface | None


def build_world(scenario: Scenario, folder: Path, rng: np.random.Generator) -> ScenarioWorld:
    """Put the scenario's world into Bullet and write its map files into ``folder``."""
    bullet = BulletWorld()
    if isinstance(scenario.world, JacksboroWorld):
        mesh = jacksboro(scenario.world.size, scenario.world.spacing, scenario.world.roughness, rng)
        bullet.add_heightfield(mesh)
        ground, walls, grid = Surface(*mesh.triangles()), None, slope_map(mesh)

        def height_at(x: float, y: float) -> float:
            return float(mesh.height_at(x, y))

    else:
        grid = read_occupancy(OFFICE_MAP if isinstance(scenario.world, OfficeWorld) else scenario.world.file)
        add_building(bullet, grid)
        ground, walls, mesh = _floor_surface(grid), Surface(*wall_triangles(grid)), storey_heights(grid)

        def height_at(x: float, y: float) -> float:
            return 0.0

    files = {"$WORLD_MAP": write_map(grid, folder, "world"), "$WORLD_MESH": write_mesh(mesh, folder / "world.ply")}
    obstacles = _add_obstacles(bullet, scenario.obstacles, height_at)
    return ScenarioWorld(bullet, files, height_at, ground, walls, obstacles)


def slope_map(terrain: Heightfield) -> OccupancyGrid:
    """Draw a terrain as a 2D map: steep cells and the border are occupied, the rest is free.

    Map cells are square, as wide as the finer spacing of the terrain; each takes the steeper of the two triangles
    of the terrain's cell that its centre lies in.
    """
    slopes = terrain.slopes().reshape(terrain.ny - 1, terrain.nx - 1, 2).max(axis=2)
    resolution = min(terrain.dx, terrain.dy)
    columns, rows = (int(length / resolution) for length in terrain.size)
    ix = np.minimum((np.arange(columns) + 0.5) * resolution / terrain.dx, terrain.nx - 2).astype(int)
    iy = np.minimum((np.arange(rows) + 0.5) * resolution / terrain.dy, terrain.ny - 2).astype(int)
    steep = slopes[np.ix_(iy, ix)] > MAX_SLOPE
    for edge in (steep[:BORDER], steep[-BORDER:], steep[:, :BORDER], steep[:, -BORDER:]):
        edge[...] = True
    return OccupancyGrid(steep, ~steep, resolution, terrain.x0, terrain.y0)


def storey_heights(grid: OccupancyGrid) -> Heightfield:
    """Turn a floor into a heightfield: walls and unknown cells are blocks on a level floor."""
    step = max(1, round(MESH_CELL / grid.resolution))
    solid = ~grid.free
    ny, nx = (size // step * step for size in solid.shape)
    blocks = solid[:ny, :nx].reshape(ny // step, step, nx // step, step).any(axis=(1, 3))
    spacing, half = step * grid.resolution, 0.5 * step * grid.resolution
    heights = np.where(blocks, np.float32(STOREY), np.float32(0.0))
    return Heightfield(heights, spacing, spacing, grid.origin_x + half, grid.origin_y + half)


def write_mesh(terrain: Heightfield, file: Path) -> Path:
    """Write a terrain's triangles as a PLY file with double precision, the same surface to the last bit."""
    vertices, faces = terrain.triangles()
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


def _add_obstacles(bullet: BulletWorld, obstacles: tuple[Obstacle, ...], height_at: HeightAt) -> Surface | None:
    """Stand the obstacles on the ground; return them as one surface to look at."""
    vertices: list[FloatArray] = []
    faces: list[NDArray[np.integer]] = []
    for obstacle in obstacles:
        length, _, height = obstacle.size
        pose = Pose.planar(obstacle.x, obstacle.y, obstacle.yaw, height_at(obstacle.x, obstacle.y) + 0.5 * height)
        if obstacle.shape == "box":
            bullet.add_box(pose, obstacle.size)
            corners, triangles = box_triangles(obstacle.size)
        else:
            bullet.add_cylinder(pose, 0.5 * length, height)
            corners, triangles = cylinder_triangles(0.5 * length, height)
        faces.append(triangles + sum(len(part) for part in vertices))
        vertices.append(corners @ pose.rotation.T + np.array(pose.position))
    if not vertices:
        return None
    return Surface(np.concatenate(vertices), np.concatenate(faces).astype(np.int32))
