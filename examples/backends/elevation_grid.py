"""A map backend of its own in one file: a 2.5D grid of heights for a round robot with a range sensor.

When to use: as the pattern of a backend, or for open ground of a known shape. When not: bridges, overhangs.
Everything but the ground is inherited: obstacles and inflation, planner, recoveries, queries, freshness.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, cast

import numpy as np

from mbf_abstract.config.configuration import Config
from mbf_abstract.geometry import FloatArray
from mbf_abstract.maps.graph.graph_map import GraphMap, GraphMapParameters, IntArray, grid_edges
from mbf_abstract.maps.graph.graph_server import GraphMapServer
from mbf_abstract.parameters import ParameterModel, parameter


class ElevationGridParameters(GraphMapParameters):
    """The configuration's block ``elevation_grid``."""

    file: str = parameter(..., "File of a (rows, columns) array of heights [m], as numpy.save writes it.")
    resolution: float = parameter(0.5, "Distance of two samples.", unit="m", gt=0.0)
    max_slope: float = parameter(0.5, "Lethal above this inclination.", unit="rad", gt=0.0, lt=1.57)


class ElevationGrid(GraphMap):
    """Heights (ny, nx) [m] with row 0 at y = 0; unknown ones (NaN) and the border are lethal."""

    def __init__(self, heights: FloatArray, parameters: ElevationGridParameters, frame_id: str) -> None:
        self.heights, self.resolution = heights, parameters.resolution
        self.slope = np.arctan(np.nan_to_num(np.hypot(*np.gradient(heights, self.resolution)), nan=np.inf))
        inside = np.pad(np.ones(np.subtract(heights.shape, 2), dtype=bool), 1)
        lethal = ~inside | (self.slope > parameters.max_slope)
        rows, columns = np.indices(heights.shape)
        x, y, z = (
            array.ravel() for array in (columns * self.resolution, rows * self.resolution, np.nan_to_num(heights))
        )
        edges = grid_edges((heights.shape[0], heights.shape[1]))
        super().__init__(np.column_stack([x, y, z]), edges, lethal.ravel(), parameters, frame_id, self.slope.ravel())

    def nodes_at(self, points: FloatArray) -> IntArray:
        """Number of the sample next to each point; -1 off the grid and where there is no height."""
        (ny, nx), (ix, iy) = self.heights.shape, np.round(points[:, :2].T / self.resolution).astype(int)
        inside = (ix >= 0) & (ix < nx) & (iy >= 0) & (iy < ny)
        nodes = np.where(inside, iy * nx + ix, 0)
        return np.where(inside & ~np.isnan(self.heights.ravel()[nodes]), nodes, -1)


class ElevationGridServer(GraphMapServer):
    """The server: it loads the map, the rest is inherited."""

    backend: ClassVar[str] = "elevation_grid"
    config_sections: ClassVar[Mapping[str, type[ParameterModel]]] = {"elevation_grid": ElevationGridParameters}

    def make_map(self, config: Config) -> ElevationGrid:
        """Read the array."""
        parameters = cast(ElevationGridParameters, config.sections["elevation_grid"].parameters)
        heights = np.load(config.path.parent / parameters.file, allow_pickle=False).astype(np.float64)
        return ElevationGrid(heights, parameters, config.parameters.global_frame)
