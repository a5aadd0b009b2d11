"""Whether the widest disc within a robot's outline gets from a pose to another: where it does not, the robot does not.

When to use: after a search for a car that found nothing, as it is a few milliseconds for a map that such a search takes
seconds for. When not: to find a path; a robot is longer than it is wide, and turns nowhere on the spot.

The test errs to one side. The outline is looked at in samples half a cell apart, between which the corner of a cell
reaches by a quarter of a cell; the centre of a cell on the disc's way is at most 0.71 cells beside that way, and the
edge of an obstacle at least half a cell before the centre of its cell. So cells nearer than the radius less half a cell
to the centre of a lethal one are closed to the disc's centre, and any path of the robot leads over others.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_abstract.geometry.arithmetic import norm
from mbf_abstract.geometry.polygon import inside_polygon
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.grid.footprint import OUTLINES_KEPT, Footprint
from mbf_costmap_nav.kernels.map.inflation import LARGEST_RADIUS, inflate

FloatArray = NDArray[np.float64]

FINENESS = 41
"""Places along each side of an outline's box where the centre of its widest disc may be; odd, for the middle."""
SPARE = 0.5
"""The disc's radius is taken smaller by so many cells, see above."""


def widest_disc(footprint: Footprint) -> tuple[float, float, float]:
    """Centre (x, y) in the base frame and radius [m] of the widest disc within an outline; all 0 for a point."""
    return _widest_disc(footprint.vertices.tobytes()) if len(footprint.vertices) >= 3 else (0.0, 0.0, 0.0)


@lru_cache(maxsize=OUTLINES_KEPT)
def _widest_disc(vertices: bytes) -> tuple[float, float, float]:
    corners = np.frombuffer(vertices).reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes = [np.linspace(low[k], high[k], FINENESS)[1:-1] for k in range(2)]
    places = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    places = places[inside_polygon(places, corners)]
    if len(places) == 0:
        return 0.0, 0.0, 0.0
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    radii = np.min([_distances(places, a, b) for a, b in sides], axis=0)
    best = int(np.argmax(radii))
    return float(places[best, 0]), float(places[best, 1]), float(radii[best])


def _distances(places: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Distances (n,) [m] of places (n, 2) from the segment between two points (2,)."""
    (dx, dy), x, y = (b - a).tolist(), places[:, 0] - a[0], places[:, 1] - a[1]
    along = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
    return np.asarray(norm(np.column_stack([x - along * dx, y - along * dy])))


def disc_gets_there(costmap: Costmap, footprint: Footprint, start: Pose, goal: Pose, tolerance: float) -> bool:
    """Whether the widest disc gets from a pose to within ``tolerance`` [m] of another, at about its heading.

    True, as nothing is known, for a robot that is a point or hundreds of cells wide, and where the disc is in an
    obstacle at the start already.
    """
    x, y, radius = widest_disc(footprint)
    cells = radius / costmap.resolution - SPARE
    if not 1.0 < cells <= LARGEST_RADIUS - 1:
        return True
    ix, iy = costmap.world_to_cell_clamped(*_placed(start, x, y))
    goal_x, goal_y = costmap.world_to_cell_clamped(*_placed(goal, x, y))
    pieces = _pieces(costmap, cells)
    reach = tolerance / costmap.resolution + 2.0 if tolerance > 0.0 else 0.0
    if pieces[iy, ix] == 0 or (reach == 0.0 and pieces[goal_y, goal_x] == 0):
        return True
    return in_reach(pieces, (ix, iy), (goal_x, goal_y), reach)


def in_reach(pieces: NDArray[np.integer], first: tuple[int, int], last: tuple[int, int], reach: float) -> bool:
    """Whether a cell (ix, iy) is of the same piece (height, width) as one at most ``reach`` [cells] from another."""
    (ix, iy), (goal_x, goal_y) = first, last
    near = int(min(reach, max(pieces.shape)))  # the reach may be inf
    left, below = max(goal_x - near, 0), max(goal_y - near, 0)
    around = pieces[below : goal_y + near + 1, left : goal_x + near + 1]
    rows, columns = np.nonzero(around == pieces[iy, ix])
    return bool(((columns + left - goal_x) ** 2 + (rows + below - goal_y) ** 2 <= reach * reach).any())


def _placed(pose: Pose, x: float, y: float) -> tuple[float, float]:
    """A point of the base frame [m] on the map."""
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return pose.x + c * x - s * y, pose.y + s * x + c * y


def _pieces(costmap: Costmap, radius: float) -> NDArray[np.integer]:
    """Number (height, width) of the connected piece of cells at least ``radius`` [cells] from lethal ones; 0 else.

    What is off the map is lethal, as a robot's outline may not leave it.
    """
    from scipy import ndimage  # takes 0.13 s to import, and most plans are found

    seeds = np.pad((costmap.cells == LETHAL).astype(np.uint8), 1, constant_values=1)
    height, width = seeds.shape
    whole, closed = math.ceil(radius), np.zeros_like(seeds)
    squares = np.arange(whole * whole + 1)
    inflate(closed, seeds, (0, 0, width, height), (squares < radius * radius).astype(np.uint8), whole, 1)
    pieces, _ = ndimage.label(closed[1:-1, 1:-1] == 0, np.ones((3, 3), dtype=bool))
    return np.asarray(pieces)
