"""The map files that a run writes of its world, one for each kind of map server.

``world.ply`` holds the triangles of Bullet's collision shapes and, where a 2D map can describe the world,
``world.yaml`` + ``world.png`` are a map_server map; both exact unless the scenario's ``map:`` adds errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from terrain.scenarios.noise import MapNoise
from terrain.worlds.floor_plan import write_map
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid
from terrain.worlds.slope_map import write_slope_map
from terrain.worlds.surface import Surface

STOREY = 1.0  # m; height of the walls in the mesh of a building
MESH_CELL = 0.1  # m; edge length of that mesh

Files = dict[str, Path]


@dataclass(frozen=True)
class MapFiles:
    """Writes a world's maps into a folder; its methods return placeholder of a configuration -> file.

    Attributes
    ----------
    noise : MapNoise
        What is wrong with the maps.
    rng : numpy Generator
        Draws the noise.
    """

    folder: Path
    noise: MapNoise
    rng: np.random.Generator

    def of_terrain(self, terrain: Heightfield, lethal_slope: float) -> Files:
        """Write open ground as mesh and as slope map; ground steeper than ``lethal_slope`` [deg] is occupied."""
        mapped = self.noise.on_terrain(terrain, self.rng)
        resolution = min(terrain.dx, terrain.dy)
        slope_map = write_slope_map(mapped, self.folder, "world", resolution, lethal_slope)
        return {"$WORLD_MESH": self._write_mesh(mapped.surface()), "$WORLD_MAP": slope_map}

    def of_building(self, grid: OccupancyGrid) -> Files:
        """Write a floor as mesh and as grid."""
        mapped = self.noise.on_grid(grid, self.rng)
        heights = self.noise.on_heights(storey_heights(mapped), self.rng)
        mesh = self._write_mesh(heights.surface())
        return {"$WORLD_MESH": mesh, "$WORLD_MAP": write_map(mapped, self.folder, "world")}

    def of_levels(self, ground: Surface) -> Files:
        """Write surfaces above each other as mesh."""
        vertices = self.noise.on_vertices(ground.vertices, self.rng)
        return {"$WORLD_MESH": self._write_mesh(Surface(vertices, ground.faces))}

    def _write_mesh(self, surface: Surface) -> Path:
        return write_mesh(surface.vertices, surface.faces, self.folder / "world.ply")


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
