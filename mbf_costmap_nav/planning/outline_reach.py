"""Whether a robot's outline gets from a pose to another at all: where it does not even sideways, no car does.

When to use: after a search for a car that found nothing, and whose widest disc gets there (``widest_disc``): it is a
tenth of a second for a map that such a search takes ten for. When not: to find a path.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mbf_abstract.geometry import Pose
from mbf_costmap_nav.grid.costmap import LETHAL, Costmap
from mbf_costmap_nav.grid.footprint import Footprint
from mbf_costmap_nav.kernels.car.outline_flood import BITS, HEADINGS, covered_runs, flood, open_headings

FINE_CELLS = 300_000
"""Maps of no more cells are looked at in half cells, larger ones, to save time, in whole ones."""
LARGEST_REACH = 120
"""An outline of more cells than that from its middle is not looked at."""


class _Bins:
    """The bins of a map and an outline: positions of the outline's middle in cells or half cells, and headings."""

    def __init__(self, costmap: Costmap, footprint: Footprint) -> None:
        self.fineness = 2 if costmap.cells.size <= FINE_CELLS else 1
        self.costmap, self.side = costmap, costmap.resolution / self.fineness
        low, high = footprint.vertices.min(axis=0), footprint.vertices.max(axis=0)
        self.middle = 0.5 * (low + high)
        self.corners = np.ascontiguousarray((footprint.vertices - self.middle) / self.side)
        self.reach = math.ceil(float(np.sqrt(np.max(np.sum(self.corners**2, axis=1)))))

    def open(self) -> NDArray[np.uint64]:
        """Words of the headings at which the outline may fit in a bin, see ``open_headings``."""
        lethal = (self.costmap.cells == LETHAL).repeat(self.fineness, axis=0).repeat(self.fineness, axis=1)
        return np.asarray(open_headings(lethal, covered_runs(self.corners, self.reach), self.reach))

    def of(self, pose: Pose) -> tuple[int, int, int]:
        """Bin (ix, iy, heading) of a pose of the base, at the border for one off the map."""
        c, s, (forward, left) = math.cos(pose.yaw), math.sin(pose.yaw), self.middle.tolist()
        x, y = pose.x + c * forward - s * left, pose.y + s * forward + c * left
        height, width = self.costmap.cells.shape
        ix = math.floor((x - self.costmap.origin_x) / self.side)
        iy = math.floor((y - self.costmap.origin_y) / self.side)
        heading = math.floor(pose.yaw / (2.0 * math.pi) * HEADINGS + 0.5) % HEADINGS
        last_x, last_y = width * self.fineness - 1, height * self.fineness - 1
        return min(max(ix, 0), last_x), min(max(iy, 0), last_y), heading

    def place_of(self, ix: int, iy: int) -> tuple[float, float]:
        """Middle (x, y) [m] of a bin."""
        return self.costmap.origin_x + (ix + 0.5) * self.side, self.costmap.origin_y + (iy + 0.5) * self.side


def where_outline_is_stuck(
    costmap: Costmap, footprint: Footprint, start: Pose, goal: Pose, tolerance: float = 0.0
) -> tuple[float, float] | None:
    """Return where an outline that moves sideways and turns on the spot gets no farther on its way between poses.

    ``tolerance`` [m]: how far from the goal will do, at whatever heading.

    Returns
    -------
    (x, y) [m], or None
        The place that it reaches nearest to where it could go on. None where it gets to the goal, or where nothing is
        known: it is a point or hundreds of cells long, or touches something at an end already.
    """
    if len(footprint.vertices) < 3:
        return None
    bins = _Bins(costmap, footprint)
    if bins.reach > LARGEST_REACH:
        return None
    words, first, last = bins.open(), bins.of(start), bins.of(goal)
    if not _has(words, first) or (tolerance == 0.0 and not _has(words, last)):
        return None
    reached = flood(words, *first)
    if tolerance > 0.0:
        around = _window(reached, last, (tolerance + costmap.resolution) / bins.side)
        return None if around.any() else _nearest(bins, reached, last)
    if _has(reached, last):
        return None
    return _nearest(bins, reached, last, flood(words, *last))


def _has(words: NDArray[np.uint64], of_bin: tuple[int, int, int]) -> bool:
    ix, iy, heading = of_bin
    return bool(int(words[iy, ix, heading // BITS]) >> (heading % BITS) & 1)


def _window(words: NDArray[np.uint64], last: tuple[int, int, int], reach: float) -> NDArray[np.uint64]:
    """Words of the cells in a square around one; the reach [cells] may be inf."""
    ix, iy, near = last[0], last[1], math.ceil(min(reach, max(words.shape)))
    return words[max(iy - near, 0) : iy + near + 1, max(ix - near, 0) : ix + near + 1]


def _nearest(
    bins: _Bins, reached: NDArray[np.uint64], last: tuple[int, int, int], beyond: NDArray[np.uint64] | None = None
) -> tuple[float, float]:
    """Place reached nearest to what is reached from the goal (by default, the goal alone), and then to the goal."""
    from scipy import ndimage  # takes 0.13 s to import, and most plans are found

    rows, columns = np.nonzero(reached.any(axis=2))
    squares = (rows - last[1]) ** 2.0 + (columns - last[0]) ** 2.0
    if beyond is not None:
        gaps = ndimage.distance_transform_edt(~beyond.any(axis=2))[rows, columns]
        squares[gaps > gaps.min()] = np.inf
    best = int(np.argmin(squares))
    return bins.place_of(int(columns[best]), int(rows[best]))
