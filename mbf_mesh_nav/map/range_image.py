"""A coarse picture of how far a sensor saw in every direction, to find which remembered points are gone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.arithmetic import arcsin, arctan2, norm
from mbf_mesh_nav.arrays import BoolArray, FloatArray

BIN_ANGLE = np.radians(1.0)
COLUMNS = round(2.0 * np.pi / BIN_ANGLE)
ROWS = round(np.pi / BIN_ANGLE) + 1
MARGIN = 0.1
"""How far [m] behind a point the rays past it have to end."""
NO_RANGE = 1e-6
"""A point this near [m] to its sensor stands for a ray without an answer; so do many drivers write it."""


class RangeImage:
    """Least range per direction bin of 1 degree around a sensor.

    Parameters
    ----------
    points : (n, 3) float64
        Where the rays of one cloud ended [m]; those at the sensor itself have no direction and are left out.
    sensor_origin : (3,) float64
    """

    def __init__(self, points: FloatArray, sensor_origin: FloatArray) -> None:
        self.sensor_origin = sensor_origin
        self._ranges = np.full((ROWS, COLUMNS), np.inf)
        away = norm(points - sensor_origin) > NO_RANGE
        rows, columns, distances = self._bins(points[away])
        np.minimum.at(self._ranges, (rows, columns), distances)

    def sees_through(self, points: FloatArray) -> BoolArray:
        """Mask (m,) of points (m, 3) that rays passed by on their way to something farther.

        A point counts as seen through if there is a ray in its own bin and all rays in that bin and the eight around
        it ended more than ``MARGIN`` behind the point. Asking for all of them keeps thin posts.
        """
        rows, columns, distances = self._bins(points)
        nearest = np.full(len(points), np.inf)
        for row_step in (-1, 0, 1):
            for column_step in (-1, 0, 1):
                around = self._ranges[np.clip(rows + row_step, 0, ROWS - 1), (columns + column_step) % COLUMNS]
                nearest = np.minimum(nearest, around)
        observed = np.isfinite(self._ranges[rows, columns])
        return np.asarray(observed & (nearest > distances + MARGIN))

    def _bins(self, points: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
        rays = points - self.sensor_origin
        distances = norm(rays)
        elevations = arcsin(np.clip(rays[:, 2] / np.maximum(distances, 1e-9), -1.0, 1.0))
        rows = np.rint((elevations + np.pi / 2.0) / BIN_ANGLE).astype(np.intp)
        columns = np.rint(arctan2(rays[:, 1], rays[:, 0]) / BIN_ANGLE).astype(np.intp) % COLUMNS
        return rows, columns, distances
