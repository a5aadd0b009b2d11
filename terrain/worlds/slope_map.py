"""A terrain as a 2D map, so that a costmap server can be run outdoors and compared with a mesh server.

A 2D map can hold how steep each cell is over the length of the robot. It cannot hold the heading of the robot on the
slope; that is what the comparison shows. Use ``slope_grid`` for a map of free and occupied cells,
``write_slope_map`` for one with every shade between.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import FloatArray
from mbf_abstract.geometry.arithmetic import arctan
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid, write_map_files
from terrain.worlds.smoothing import smoothed

LETHAL_SLOPE = 30.0  # degrees; where a skid-steered robot of the kind of a Husky begins to slide sideways
FREE_SLOPE = 5.0  # degrees; gentler ground costs nothing
ROBOT_LENGTH = 0.5  # m; bumps shorter than this are driven over, they are not slopes
BORDER = 0.5  # m at the edge of the terrain that count as occupied
OCCUPIED = 100


def cell_slopes(terrain: Heightfield, resolution: float) -> FloatArray:
    """Slope [degrees] of square cells of ``resolution`` [m], as (ny, nx) float64.

    Cell [0, 0] has its lower left corner at the terrain's; heights are smoothed first by a Gaussian whose width (four
    sigma) is the length of a small robot, 0.5 m. A single row or column of cells has no slope across.
    """
    nx, ny = (max(1, int(length / resolution)) for length in terrain.size)
    x = terrain.x0 + (np.arange(nx) + 0.5) * resolution
    y = terrain.y0 + (np.arange(ny) + 0.5) * resolution
    heights = terrain.height_at(*np.meshgrid(x, y))
    sigma = 0.25 * ROBOT_LENGTH / resolution
    smooth = smoothed(heights, (sigma, sigma))
    rise_y, rise_x = (
        np.gradient(smooth, resolution, axis=axis) if cells > 1 else np.zeros_like(smooth)
        for axis, cells in enumerate(smooth.shape)
    )
    return np.asarray(np.degrees(arctan(np.hypot(rise_x, rise_y))))


def slope_occupancy(terrain: Heightfield, resolution: float, lethal_slope: float = LETHAL_SLOPE) -> NDArray[np.uint8]:
    """Occupancies (ny, nx) uint8: 0 up to 5 degrees, rising evenly to 100 at ``lethal_slope`` and at the border."""
    share = (cell_slopes(terrain, resolution) - FREE_SLOPE) / (lethal_slope - FREE_SLOPE)
    occupancy = np.rint(OCCUPIED * np.clip(share, 0.0, 1.0)).astype(np.uint8)
    edge = max(1, round(BORDER / resolution))
    for edge_cells in (occupancy[:edge], occupancy[-edge:], occupancy[:, :edge], occupancy[:, -edge:]):
        edge_cells[...] = OCCUPIED
    return occupancy


def slope_grid(terrain: Heightfield, resolution: float, lethal_slope: float = LETHAL_SLOPE) -> OccupancyGrid:
    """Map of a terrain where ground steeper than ``lethal_slope`` [degrees] and the border are occupied."""
    return _as_grid(terrain, resolution, slope_occupancy(terrain, resolution, lethal_slope))


def _as_grid(terrain: Heightfield, resolution: float, occupancy: NDArray[np.uint8]) -> OccupancyGrid:
    occupied = occupancy == OCCUPIED
    return OccupancyGrid(occupied, ~occupied, resolution, terrain.x0, terrain.y0)


def write_slope_map(
    terrain: Heightfield, folder: str | Path, name: str, resolution: float, lethal_slope: float = LETHAL_SLOPE
) -> Path:
    """Write map_server files of mode ``raw``: pixels are occupancies, so the shades survive. Return the yaml's path."""
    occupancy = slope_occupancy(terrain, resolution, lethal_slope)
    return write_map_files(Path(folder) / name, occupancy, _as_grid(terrain, resolution, occupancy), "mode: raw\n")
