"""Put a building into a PyBullet world: a level floor, and every occupied cell of a map as a wall."""

from __future__ import annotations

from terrain.physics.world import BulletWorld
from terrain.worlds.occupancy import OccupancyGrid, wall_surface

WALL_HEIGHT = 2.0


def add_building(world: BulletWorld, grid: OccupancyGrid, wall_height: float = WALL_HEIGHT) -> None:
    """Add floor and walls of a map; one without an occupied cell has no walls.

    Parameters
    ----------
    world : BulletWorld
    grid : OccupancyGrid
        From ``read_occupancy`` or ``FloorPlan.draw``; unknown cells become floor.
    wall_height : float
        [m]
    """
    world.add_ground_plane(*grid.bounds)
    if grid.occupied.any():
        world.add_mesh(*wall_surface(grid, wall_height), ground=False)
