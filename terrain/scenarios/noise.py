"""Errors of what the navigation gets in a scenario: noise of its pose, and errors of its map.

Only the server gets the noisy pose and the noisy map; the physics and the verdict on a run use the true ones.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from mbf_abstract.geometry import FloatArray
from mbf_abstract.parameters import ParameterModel, parameter
from terrain.scenarios.places import FARTHEST
from terrain.worlds.heightfield import Heightfield
from terrain.worlds.occupancy import OccupancyGrid


class LocalizationNoise(ParameterModel):
    """White noise of each pose that the localisation gives, 60 poses a second; standard deviations."""

    position_noise: float = parameter(0.0, "Error along x, and along y.", unit="m", ge=0.0, le=FARTHEST)
    height_noise: float = parameter(0.0, "Error of the height.", unit="m", ge=0.0, le=FARTHEST)
    yaw_noise: float = parameter(0.0, "Error of the heading.", unit="deg", ge=0.0, lt=180.0)
    tilt_noise: float = parameter(0.0, "Error of roll, and of pitch.", unit="deg", ge=0.0, lt=45.0)

    def widened(self, position: float, angle: float) -> LocalizationNoise:
        """Return the noise with independent errors of x, y and z [m] and of all three angles [deg] added."""
        errors = {
            "position_noise": math.hypot(self.position_noise, position),
            "height_noise": math.hypot(self.height_noise, position),
            "yaw_noise": math.hypot(self.yaw_noise, angle),
            "tilt_noise": math.hypot(self.tilt_noise, angle),
        }
        return self.model_copy(update=errors)  # may be more than one of them may be


class MapNoise(ParameterModel):
    """Errors of the map that the navigation gets; the world itself does not change."""

    height_noise: float = parameter(0.0, "Standard deviation of each vertex's height.", unit="m", ge=0.0, le=FARTHEST)
    spacing: float | None = parameter(
        None, "Distance of the samples of open ground on the map; absent = the world's own.", unit="m", gt=0.01
    )
    cell_noise: float = parameter(
        0.0, "Share of the cells along the walls of a building that the map has wrong.", ge=0.0, le=1.0
    )

    def on_terrain(self, terrain: Heightfield, rng: np.random.Generator) -> Heightfield:
        """Return the open ground as the map shows it."""
        mapped = terrain if self.spacing is None else terrain.resample(self.spacing)
        return self.on_heights(mapped, rng)

    def on_heights(self, heights: Heightfield, rng: np.random.Generator) -> Heightfield:
        """Return a heightfield with the noise of heights alone."""
        if self.height_noise == 0.0:
            return heights
        return heights.with_heights(heights.heights + rng.normal(scale=self.height_noise, size=heights.heights.shape))

    def on_vertices(self, vertices: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the vertices (n, 3) [m] of a mesh as the map shows them; those in one place stay in one place."""
        if self.height_noise == 0.0:
            return vertices
        places, place_of = np.unique(vertices, axis=0, return_inverse=True)
        errors = rng.normal(scale=self.height_noise, size=len(places))
        mapped = vertices.copy()
        mapped[:, 2] += errors[place_of.reshape(-1)]
        return mapped

    def on_grid(self, grid: OccupancyGrid, rng: np.random.Generator) -> OccupancyGrid:
        """Return a building's cells as the map shows them: some on either side of a wall's face are turned over."""
        if self.cell_noise == 0.0:
            return grid
        inside = grid.occupied & ndimage.binary_dilation(grid.free)
        outside = grid.free & ndimage.binary_dilation(grid.occupied)
        wrong = (inside | outside) & (rng.uniform(size=grid.free.shape) < self.cell_noise)
        return OccupancyGrid(grid.occupied ^ wrong, grid.free ^ wrong, grid.resolution, grid.origin_x, grid.origin_y)
