"""The footprint as samples, prepared for fast collision checks of many poses on a costmap snapshot.

When to use: inside controllers, recoveries and kinematic planners. When not: a client's query about one pose; the
queries rasterise the footprint exactly. Unknown cells and poses outside the map do not collide, because a rolling
window ends near the robot.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry.polygon import inside_polygon
from mbf_costmap_nav.control.path_geometry import resample
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.map.footprint_cost import collisions, first_collision, first_lethal, footprint_cost

FloatArray = NDArray[np.float64]

OUTLINES_KEPT = 32
"""Samples of so many outlines are kept: plans and motions ask for those of a few robots again and again."""


ROUNDING = 1e-6
"""How much [cells] nearer a cell counts than it is."""


class FootprintCheck:
    """A footprint as a set of samples.

    Attributes
    ----------
    samples : (n, 2) float64
        Footprint samples in the base frame [m], outline first; the origin alone for a point robot. Not to be written
        to: other checks of this outline have the same array.
    """

    def __init__(self, footprint: Footprint, resolution: float) -> None:
        self.footprint = footprint
        self.samples, self._squares = _samples(footprint.vertices.tobytes(), resolution)

    def cost(self, costmap: Costmap, x: float, y: float, yaw: float) -> int:
        """Largest cost under the footprint; -1 if it leaves the map."""
        return int(
            footprint_cost(
                costmap.cells, costmap.resolution, costmap.origin_x, costmap.origin_y, self.samples, x, y, yaw
            )
        )

    def collides(self, costmap: Costmap, x: float, y: float, yaw: float) -> bool:
        """Whether a lethal cell lies under the footprint at a pose x, y [m], yaw [rad]."""
        return self.cost(costmap, x, y, yaw) == LETHAL

    def touched(self, costmap: Costmap, x: float, y: float, yaw: float) -> tuple[float, float] | None:
        """Centre (x, y) [m] of a lethal cell under the footprint; None if there is none."""
        grid = costmap.cells, costmap.resolution, costmap.origin_x, costmap.origin_y
        ix, iy = first_lethal(*grid, self.samples, x, y, math.cos(yaw), math.sin(yaw))
        return None if ix < 0 else costmap.cell_to_world(int(ix), int(iy))

    def first_collision(self, costmap: Costmap, poses: FloatArray) -> int:
        """Index of the first colliding pose of (n, 3) poses (x, y, yaw), or -1."""
        return int(
            first_collision(costmap.cells, costmap.resolution, costmap.origin_x, costmap.origin_y, self.samples, poses)
        )

    def first_collision_of_turn(self, costmap: Costmap, poses: FloatArray) -> int:
        """As ``first_collision``, for poses (n, 3: x, y [m], yaw [rad]) of a turn on the spot.

        Samples that pass below every lethal cell on their circle are left out, most of the time all of them.
        """
        x, y = poses[0, :2].tolist()
        reach = math.sqrt(float(np.max(self._squares)))
        samples = self.samples[self._squares >= _nearest_lethal(costmap, x, y, reach)]
        if len(samples) == 0:
            return -1
        geometry = costmap.resolution, costmap.origin_x, costmap.origin_y
        return int(first_collision(costmap.cells, *geometry, samples, poses))

    def collisions(self, costmap: Costmap, poses: FloatArray) -> NDArray[np.bool_]:
        """Which of (n, 3) poses (x, y, yaw) collide, (n,)."""
        return np.asarray(
            collisions(costmap.cells, costmap.resolution, costmap.origin_x, costmap.origin_y, self.samples, poses)
        )


@lru_cache(maxsize=OUTLINES_KEPT)
def _samples(vertices: bytes, resolution: float) -> tuple[FloatArray, FloatArray]:
    """``footprint_samples`` of the bytes of vertices (n, 2) float64, and the squares (n,) of their distances [m^2].

    Writable, as kernels know one kind of arrays.
    """
    samples = footprint_samples(np.frombuffer(vertices).reshape(-1, 2), resolution)
    return samples, samples[:, 0] ** 2 + samples[:, 1] ** 2


def _nearest_lethal(costmap: Costmap, x: float, y: float, reach: float) -> float:
    """Square [m^2] of the distance to the nearest lethal cell within ``reach`` [m], rounded down; inf without one."""
    resolution, wide = costmap.resolution, reach + costmap.resolution
    x0, y0 = costmap.world_to_cell_clamped(x - wide, y - wide)
    x1, y1 = costmap.world_to_cell_clamped(x + wide, y + wide)
    rows, columns = np.nonzero(costmap.cells[y0 : y1 + 1, x0 : x1 + 1] == LETHAL)
    if len(rows) == 0:
        return np.inf
    # In cells, from the place to the nearest side of each cell; negative where it lies between both sides.
    left = columns + (x0 - (x - costmap.origin_x) / resolution)
    low = rows + (y0 - (y - costmap.origin_y) / resolution)
    dx, dy = np.maximum(np.maximum(left, -left - 1.0), 0.0), np.maximum(np.maximum(low, -low - 1.0), 0.0)
    nearest = math.sqrt(float(np.min(dx * dx + dy * dy)))
    return (max(nearest - ROUNDING, 0.0) * resolution) ** 2


def footprint_samples(vertices: FloatArray, resolution: float) -> FloatArray:
    """Points (k, 2) [m] on the outline of a polygon (n, 2) [m], half a cell apart, and inside it, a cell apart.

    ``resolution`` is the side of a cell [m].
    """
    if len(vertices) < 3:
        return np.zeros((1, 2))
    outline = resample(np.vstack([vertices, vertices[:1]]), 0.5 * resolution)[:-1]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    counts = [max(2, math.ceil(extent / resolution) + 1) for extent in high - low]
    axes = [np.linspace(low[k], high[k], counts[k])[1:-1] for k in range(2)]
    lattice = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return np.ascontiguousarray(np.vstack([outline, lattice[inside_polygon(lattice, vertices)]]))
